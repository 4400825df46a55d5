"""PX4 1.16: main and sub modes, ignore bits per axis, offboard only with a stream, takeoff by set-point."""

from __future__ import annotations

import math
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import SetpointAttitude, SetpointLocal, Vector
from sitl.autopilot.attitude_setpoints import thrusting
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
    IGNORE_POSITION,
    POSITION,
    VELOCITY,
    Pose,
    Reading,
    Refusal,
    Setpoint,
    rotated,
    unusable,
)
from sitl.vehicle.battery import Charge

_NUMBERS: Final = {
    Mode.STANDBY: (1, 0),
    Mode.POSITION: (3, 0),
    Mode.TAKEOFF: (4, 2),
    Mode.HOLD: (4, 3),
    Mode.MISSION: (4, 4),
    Mode.RETURN: (4, 5),
    Mode.LAND: (4, 6),
    Mode.FOLLOW: (4, 8),
    Mode.GUIDED: (6, 0),
}
_MODES: Final = {number: mode for mode, number in _NUMBERS.items() if mode is not Mode.STANDBY}
_LOSS: Final = {"hold": Mode.HOLD, "land": Mode.LAND, "return": Mode.RETURN, "descend": Mode.POSITION}
# Longest set-point interval (s): offboard needs at least 2 Hz.
_MAX_SETPOINT_INTERVAL: Final = 0.5


class Px4:
    """Dialect and rules of PX4.

    Modes: POSCTL 3, AUTO 4 (TAKEOFF 2, LOITER 3, MISSION 4, RTL 5, LAND 6, FOLLOW 8), OFFBOARD 6; custom_mode
    is main << 16 | sub << 24.
    """

    autopilot = mavlink.MAV_AUTOPILOT_PX4
    boot_mode = Mode.HOLD
    stream_first = True
    stops = False
    reports_ekf = False
    echoes_yaw = True
    shortest_interval = 1000
    bytewise = True
    groups_streams = False
    after_takeoff = Mode.HOLD
    after_landing = Mode.HOLD
    keeps_choice = True
    after_return = Mode.HOLD
    after_mission = Mode.HOLD
    # PX4 turns SET_MODE into a DO_SET_MODE.
    set_mode_ack = mavlink.MAV_CMD_DO_SET_MODE
    first_item = 0
    start_arms = True
    # EKF2_NOAID_TOUT.
    coasting = 5.0
    position_loss_timeout_us = 0
    blind_text = "Failsafe: no position, blind land"
    doubt_prefix = "Preflight Fail: "
    repeats_doubts = False
    checks_mode = True
    battery_timeout_us = 0
    repositioning = Mode.HOLD
    loiter = Mode.HOLD

    def __init__(self, config: AutopilotConfig) -> None:
        self.configure(config)

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        self.after_loss = _LOSS[config.offboard_loss]
        self._timeout = round(config.offboard_timeout * 1e6)
        self._takeoff_height = config.takeoff_height
        self._battery = config.battery_failsafe
        fence = config.fence
        self.fence_rules = Rules(
            True, True, limit(fence.height, 0.0), limit(fence.radius, 0.0), fence.action or "hold"
        )

    def custom_mode(self, mode: Mode) -> int:
        """Return HEARTBEAT.custom_mode."""
        main, sub = _NUMBERS[mode]
        return main << 16 | sub << 24

    def base_mode(self, mode: Mode) -> int:
        """Return HEARTBEAT.base_mode without the armed bit."""
        flags: int = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        if mode in (Mode.STANDBY, Mode.POSITION):
            flags |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        elif mode is not Mode.GUIDED:
            flags |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED | mavlink.MAV_MODE_FLAG_AUTO_ENABLED
        return flags

    def split(self, custom_mode: int, /) -> tuple[int, int]:
        """Return ``custom_mode`` as the two parameters of DO_SET_MODE."""
        return custom_mode >> 16 & 0xFF, custom_mode >> 24

    def requested(self, main: int, sub: int, /) -> Mode | None:
        """Return the mode that DO_SET_MODE (176) requests, or None."""
        return _MODES.get((main, sub))

    def armable_mode(self, mode: Mode, /) -> bool:
        """Return whether arming is allowed in ``mode``."""
        return mode not in (Mode.FOLLOW, Mode.RETURN, Mode.LAND)

    def arming_refusal(self, status: Status) -> str | None:
        """Return the reason against arming now, or None."""
        if status.mode is Mode.GUIDED and not _streaming(status):
            return "no offboard signal"
        return None if self.armable_mode(status.mode) else f"{status.mode.name} mode is not armable"

    def mode_refusal(self, mode: Mode, status: Status) -> CommandRefusal | None:
        """Return the reason against entering ``mode`` now, or None."""
        # While disarmed OFFBOARD can be chosen without a stream, which is then checked at arming.
        if mode is Mode.GUIDED and status.armed and not _streaming(status):
            return CommandRefusal(
                mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "OFFBOARD needs set-points at more than 2 Hz"
            )
        if not status.ready and (status.landed or mode is not Mode.LAND):
            return CommandRefusal(
                mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "Mode change refused: no position estimate"
            )
        if mode is Mode.MISSION and not status.items:
            return CommandRefusal(
                mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "Mode change refused: no valid mission"
            )
        return None

    def battery_condition(self, charge: Charge, /) -> BatteryCondition:
        """Return the severity of the battery's state, by its remaining charge."""
        battery = self._battery
        if charge.remaining < battery.emergency:
            return BatteryCondition(3, "at its end", None if battery.action == "warn" else Mode.LAND)
        if charge.remaining < battery.critical:
            return BatteryCondition(2, "critical", ACTIONS[battery.action])
        return BatteryCondition(1, "low") if charge.remaining < battery.low else BatteryCondition(0)

    def takeoff(
        self, altitude: float, relative: bool | None, ground: float, status: Status, /
    ) -> Takeoff | CommandRefusal:
        """Decide on NAV_TAKEOFF (22) to ``altitude`` (m above home if ``relative``, else above sea level).

        NaN means the default height; a takeoff in flight never descends.
        """
        if not status.ready:
            return CommandRefusal(
                mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "Takeoff refused: no position estimate"
            )
        if math.isinf(altitude):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Takeoff altitude is not finite")
        height = altitude if relative else altitude - ground
        if not status.landed and not status.taking_off:
            height = height if height > status.height else status.height
        # The height is at least the default, MIS_TAKEOFF_ALT, as on PX4.
        return Takeoff(height if height > self._takeoff_height else self._takeoff_height, Mode.TAKEOFF)

    def read(self, message: SetpointLocal, here: Pose) -> Reading:
        """Interpret a set-point; ``here`` resolves body axes."""
        mask = message.type_mask
        if fault := unusable(message, mask):
            return Refusal(fault)
        if mask & mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET:
            return Refusal("Set-point refused: force is not supported")
        if message.frame not in (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_NED):
            return Refusal(f"Set-point refused: frame {message.frame}")
        if message.frame == mavlink.MAV_FRAME_BODY_NED and mask & IGNORE_POSITION != IGNORE_POSITION:
            return Refusal("Set-point refused: position in a body frame")
        positions, velocities, accelerations = (_used(mask, shift) for shift in (0, 3, 6))
        if any(used[0] != used[1] for used in (positions, velocities, accelerations)):
            return Refusal(f"Set-point refused: x without y, mask 0x{mask:X}")
        levels = tuple(map(_level, positions, velocities, accelerations))
        if None in levels:
            return Refusal(f"Set-point refused: an axis is free, mask 0x{mask:X}")

        turn = here.yaw if message.frame == mavlink.MAV_FRAME_BODY_NED else 0.0
        return Setpoint(
            levels,  # type: ignore[arg-type]
            _where(positions, message.position),
            rotated(_where(velocities, message.velocity), turn),
            rotated(_where(accelerations, message.acceleration), turn),
            None if mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE else message.yaw,
            None if mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE else message.yaw_rate,
            complete=all(positions) and all(velocities),
        )

    def read_attitude(self, message: SetpointAttitude, /) -> Reading:
        """Interpret an attitude and a thrust."""
        return thrusting(message)

    def steering_refusal(self, status: Status) -> str | None:
        """Return None to follow set-points now, or an empty text to ignore them without complaint."""
        return None if status.mode is Mode.GUIDED and status.armed else ""

    def timeout(self, _setpoint: Setpoint, /) -> int | None:
        """Return how long (µs) a set-point is followed without a successor."""
        return self._timeout


def _streaming(status: Status) -> bool:
    return status.stream_age <= _MAX_SETPOINT_INTERVAL and status.stream_gap <= _MAX_SETPOINT_INTERVAL


def _used(mask: int, shift: int) -> tuple[bool, bool, bool]:
    return not mask >> shift & 1, not mask >> shift & 2, not mask >> shift & 4


def _level(position: bool, velocity: bool, acceleration: bool) -> int | None:
    return POSITION if position else VELOCITY if velocity else ACCELERATION if acceleration else None


def _where(used: tuple[bool, bool, bool], vector: Vector) -> Vector:
    return tuple(value if use else 0.0 for use, value in zip(used, vector, strict=True))  # type: ignore[return-value]
