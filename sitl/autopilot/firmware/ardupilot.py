"""ArduCopter 4.6: single-number modes, triples of ignore bits, offset and body frames, takeoff by command."""

from __future__ import annotations

import math
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import SetpointAttitude, SetpointLocal, Vector
from sitl.autopilot.attitude_setpoints import climbing
from sitl.autopilot.fences import Rules
from sitl.autopilot.firmware import (
    ACTIONS,
    BatteryCondition,
    CommandRefusal,
    Mode,
    Status,
    Takeoff,
    limit,
)
from sitl.config.autopilot import AutopilotConfig
from sitl.values.setpoints import (
    ACCELERATION,
    IGNORE_ACCELERATION,
    IGNORE_POSITION,
    IGNORE_VELOCITY,
    POSITION,
    VELOCITY,
    ZERO,
    Pose,
    Reading,
    Refusal,
    Setpoint,
    Stop,
    rotated,
    unusable,
)
from sitl.vehicle.battery import Charge

_NUMBERS: Final[dict[Mode, int]] = {
    Mode.STANDBY: mavlink.COPTER_MODE_STABILIZE,
    Mode.MISSION: mavlink.COPTER_MODE_AUTO,
    Mode.GUIDED: mavlink.COPTER_MODE_GUIDED,
    Mode.TAKEOFF: mavlink.COPTER_MODE_GUIDED,
    Mode.POSITION: mavlink.COPTER_MODE_LOITER,
    Mode.RETURN: mavlink.COPTER_MODE_RTL,
    Mode.LAND: mavlink.COPTER_MODE_LAND,
    Mode.HOLD: mavlink.COPTER_MODE_BRAKE,
    Mode.FOLLOW: mavlink.COPTER_MODE_FOLLOW,
}
_MODES: Final = {number: mode for mode, number in _NUMBERS.items() if mode is not Mode.TAKEOFF}
_NAMES: Final = {Mode.MISSION: "AUTO", Mode.RETURN: "RTL", Mode.HOLD: "BRAKE"}
_NOT_ARMABLE: Final = (Mode.LAND, Mode.HOLD, Mode.MISSION, Mode.RETURN, Mode.FOLLOW)
_FRAMES: Final = (
    mavlink.MAV_FRAME_LOCAL_NED,
    mavlink.MAV_FRAME_LOCAL_OFFSET_NED,
    mavlink.MAV_FRAME_BODY_NED,
    mavlink.MAV_FRAME_BODY_OFFSET_NED,
)
_TRIPLES: Final = (IGNORE_POSITION, IGNORE_VELOCITY, IGNORE_ACCELERATION)


class ArduPilot:
    """Dialect and rules of ArduCopter.

    The force bit of a set-point has no effect, because MAVProxy's velocity command sets it.
    """

    autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    boot_mode = Mode.STANDBY
    stream_first = False
    stops = True
    reports_ekf = True
    echoes_yaw = False
    # Streams are served from the 400 Hz loop, at no more than 80 % of its rate.
    shortest_interval = 3125
    bytewise = False
    groups_streams = True
    after_takeoff = Mode.GUIDED
    after_landing = Mode.LAND
    keeps_choice = False
    after_return = Mode.RETURN
    after_mission = Mode.MISSION
    # The acknowledgement names the id of the message as if it were a command's.
    set_mode_ack = mavlink.MAVLINK_MSG_ID_SET_MODE
    first_item = 1
    start_arms = False
    after_loss = Mode.GUIDED
    # EKF3's posRetryTimeNoVel; then ten failures of the check that runs at 10 Hz.
    coasting = 7.0
    position_loss_timeout_us = 1_000_000
    blind_text = "EKF Failsafe: changed to LAND Mode"
    doubt_prefix = "PreArm: "
    repeats_doubts = True
    checks_mode = False
    # BATT_LOW_TIMER.
    battery_timeout_us = 10_000_000
    repositioning = Mode.GUIDED
    loiter = Mode.POSITION

    def __init__(self, config: AutopilotConfig) -> None:
        self.configure(config)

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        self._timeout = round(config.guided_timeout * 1e6)
        self._climb, self._sink = config.waypoint_climb, config.waypoint_sink
        self._battery = config.battery_failsafe
        self._follows = config.follow.enabled == "on"
        fence = config.fence
        kinds = round(fence.kinds)
        self.fence_rules = Rules(
            fence.enabled == "on",
            False,
            limit(fence.height, 100.0) if kinds & mavlink.FENCE_TYPE_ALT_MAX else math.inf,
            limit(fence.radius, 300.0) if kinds & mavlink.FENCE_TYPE_CIRCLE else math.inf,
            fence.action or "return",
            areas=bool(kinds & mavlink.FENCE_TYPE_POLYGON),
            floor=fence.floor if kinds & mavlink.FENCE_TYPE_ALT_MIN else -math.inf,
        )

    def custom_mode(self, mode: Mode) -> int:
        """Return HEARTBEAT.custom_mode."""
        return _NUMBERS[mode]

    def base_mode(self, mode: Mode) -> int:
        """Return HEARTBEAT.base_mode without the armed bit."""
        flags: int = (
            mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
            | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        )
        if mode not in (Mode.STANDBY, Mode.POSITION):
            flags |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
        return flags

    def split(self, custom_mode: int, /) -> tuple[int, int]:
        """Return ``custom_mode`` as the two parameters of DO_SET_MODE."""
        return custom_mode, 0

    def requested(self, main: int, _sub: int, /) -> Mode | None:
        """Return the mode that DO_SET_MODE (176) requests, or None."""
        return _MODES.get(main)

    def armable_mode(self, mode: Mode, /) -> bool:
        """Return whether arming is allowed in ``mode``."""
        return mode not in _NOT_ARMABLE

    def arming_refusal(self, status: Status) -> str | None:
        """Return the reason against arming in the present mode, or None."""
        name = _NAMES.get(status.mode, status.mode.name)
        return None if self.armable_mode(status.mode) else f"{name} mode is not armable"

    def mode_refusal(self, mode: Mode, status: Status) -> CommandRefusal | None:
        """Return the reason against entering ``mode`` now, or None."""
        if mode is Mode.STANDBY and status.armed and not status.landed:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "STABILIZE in flight needs a pilot")
        if mode not in (Mode.STANDBY, Mode.LAND) and not status.ready:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Mode change failed: requires position")
        if mode is Mode.FOLLOW and not self._follows:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Mode change to FOLLOW failed: FOLL_ENABLE is 0")
        if mode is Mode.MISSION and not status.items:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Mode change to AUTO failed: no mission")
        if mode is Mode.MISSION and status.armed and status.landed and not status.takes_off:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Auto: Missing Takeoff Cmd")
        return None

    def battery_condition(self, charge: Charge, /) -> BatteryCondition:
        """Return the severity of the battery's state, by voltage."""
        battery = self._battery
        if charge.voltage < battery.critical_voltage:
            return BatteryCondition(2, "critical", ACTIONS[battery.critical_action])
        if charge.voltage < battery.low_voltage:
            return BatteryCondition(1, "low", ACTIONS[battery.low_action])
        return BatteryCondition(0)

    def takeoff(
        self, altitude: float, relative: bool | None, _ground: float, status: Status, /
    ) -> Takeoff | CommandRefusal:
        """Decide on NAV_TAKEOFF (22) to ``altitude`` (m above home)."""
        if relative is False:
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Takeoff needs an altitude above home")
        if not math.isfinite(altitude) or altitude <= 0.0:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Takeoff needs a positive altitude")
        if status.mode is not Mode.GUIDED:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Takeoff needs GUIDED mode")
        if not status.armed:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Takeoff needs armed motors")
        if not status.landed and not status.taking_off:
            return CommandRefusal(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "Takeoff refused: already flying")
        return Takeoff(altitude, Mode.GUIDED)

    def read(self, message: SetpointLocal, here: Pose) -> Reading:
        """Interpret a set-point; ``here`` resolves offsets and body axes."""
        mask = message.type_mask
        for triple in _TRIPLES:
            mask |= triple if mask & triple else 0
        if fault := unusable(message, mask):
            return Refusal(fault)
        if message.frame not in _FRAMES:
            return Stop(f"Set-point stops: frame {message.frame}")
        position, velocity, acceleration = (not mask & triple for triple in _TRIPLES)
        if (position and acceleration and not velocity) or not (position or velocity or acceleration):
            return Stop(f"Set-point stops: mask 0x{message.type_mask:X}")

        level = POSITION if position else VELOCITY if velocity else ACCELERATION
        body = message.frame in (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED)
        turn = here.yaw if body else 0.0
        yaw = None if mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE else message.yaw + turn
        return Setpoint(
            (level, level, level),
            _placed(message, here) if position else ZERO,
            _turned(message.velocity, turn) if velocity else ZERO,
            _turned(message.acceleration, turn) if acceleration else ZERO,
            yaw,
            None if mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE else message.yaw_rate,
            complete=position and velocity,
        )

    def read_attitude(self, message: SetpointAttitude, /) -> Reading:
        """Interpret an attitude, with its thrust as a climb rate."""
        return climbing(message, self._climb, self._sink)

    def steering_refusal(self, status: Status) -> str | None:
        """Return the reason against following a good set-point now, or None."""
        if status.mode is not Mode.GUIDED:
            return "Set-point ignored: not in GUIDED"
        if not status.armed:
            return "Set-point ignored: disarmed"
        if status.landed:
            return "Set-point ignored: landed, take off first"
        return None

    def timeout(self, setpoint: Setpoint, /) -> int | None:
        """Return how long (µs) ``setpoint`` is followed without a successor; None if it does not move."""
        return self._timeout if setpoint.moves else None


def _turned(vector: Vector, yaw: float) -> Vector:
    return rotated(vector, yaw) if yaw else vector


def _placed(message: SetpointLocal, here: Pose) -> Vector:
    """Return the position (m, local NED) of a set-point.

    Frame 1 counts from the origin; frame 7 from here, along north and east; frames 8 and 9 from here, along
    the body's axes.
    """
    if message.frame == mavlink.MAV_FRAME_LOCAL_NED:
        return message.position
    turn = 0.0 if message.frame == mavlink.MAV_FRAME_LOCAL_OFFSET_NED else here.yaw
    dx, dy, dz = _turned(message.position, turn)
    x, y, z = here.position
    return x + dx, y + dy, z + dz
