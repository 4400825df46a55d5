"""Differences between ArduPilot and PX4, behind one small interface.

The commander receives requests; a ``Firmware`` (elsewhere called *flavour*) decides whether they are
allowed, numbers the modes and interprets set-points. Apart from ``configure``, its methods are pure: the
results depend on the arguments and the settings only. Sources: measurements in flights of ArduCopter
4.6.3 and PX4 1.16.1.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Final, NamedTuple, Protocol

from mavlink_bridge.messages import SetpointAttitude, SetpointLocal
from sitl.autopilot.fences import Rules
from sitl.config.autopilot import AutopilotConfig
from sitl.values.setpoints import Pose, Reading, Setpoint
from sitl.vehicle.battery import Charge


class Mode(Enum):
    """Flight mode, independent of the firmware; a ``Firmware`` maps it to a number."""

    STANDBY = "standby"
    POSITION = "position"
    HOLD = "hold"
    GUIDED = "guided"
    TAKEOFF = "takeoff"
    LAND = "land"
    MISSION = "mission"
    RETURN = "return"
    FOLLOW = "follow"


ACTIONS: Final = {"warn": None, "hold": Mode.HOLD, "land": Mode.LAND, "return": Mode.RETURN}
"""Modes that failsafe actions enter, by the names in the settings."""


def limit(setting: float | None, usual: float) -> float:
    """Return ``setting`` (m), or ``usual`` if it is None; a result of 0 becomes infinity (no limit)."""
    return (usual if setting is None else setting) or math.inf


class Status(NamedTuple):
    """Inputs of a decision.

    ``height`` (m) is above home. ``stream_age`` and ``stream_gap`` (s) are the time since the last usable
    set-point, and between it and its predecessor (0 if it is the first of its stream). ``items`` and
    ``takes_off``: how many items the mission has, and whether it begins with a takeoff; set only when the
    mission mode is requested.
    """

    armed: bool
    landed: bool
    ready: bool
    mode: Mode
    height: float
    taking_off: bool
    stream_age: float
    stream_gap: float
    items: int = 0
    takes_off: bool = False


class BatteryCondition(NamedTuple):
    """Severity of the battery's state (0: good), its name, and the mode that follows, if any."""

    level: int
    word: str = ""
    mode: Mode | None = None


class Takeoff(NamedTuple):
    """Accepted takeoff: climb to ``height`` (m above home) in ``mode``."""

    height: float
    mode: Mode


class CommandRefusal(NamedTuple):
    """Refusal, temporary or final: a MAV_RESULT and the reason."""

    result: int
    reason: str


class Firmware(Protocol):
    """Dialect and rules of one firmware."""

    autopilot: int
    """MAV_AUTOPILOT."""
    boot_mode: Mode
    stream_first: bool
    """Whether set-points count before GUIDED is entered, and can lift the vehicle off the ground in it."""
    stops: bool
    """Whether a set-point in an unknown frame means *stop*, else it is refused. True for ArduPilot only."""
    reports_ekf: bool
    """Whether EKF_STATUS_REPORT (193) is streamed."""
    echoes_yaw: bool
    """Whether POSITION_TARGET_LOCAL_NED (85) includes yaw."""
    shortest_interval: int
    """µs; SET_MESSAGE_INTERVAL (511) refuses shorter intervals."""
    bytewise: bool
    """Whether integer parameters are sent as their bytes (PARAM_ENCODE_BYTEWISE)."""
    groups_streams: bool
    """Whether REQUEST_DATA_STREAM (66) is supported."""
    after_takeoff: Mode
    after_landing: Mode
    keeps_choice: bool
    """Whether disarming restores the last chosen mode.

    A mode chosen while armed counts only if arming is allowed in it. If True, GUIDED also resumes after a
    time-out when set-points arrive again.
    """
    after_return: Mode
    after_mission: Mode
    """The mode after the last item."""
    set_mode_ack: int
    """The command that COMMAND_ACK (77) names after SET_MODE (11)."""
    first_item: int
    """The first mission item that is flown: ArduPilot keeps home as item 0."""
    start_arms: bool
    """Whether MISSION_START (300) arms."""
    after_loss: Mode
    """The mode after set-points have timed out."""
    coasting: float
    """Time without GPS during which the filter reports a position (s)."""
    position_loss_timeout_us: int
    """Time in flight without a position after which the vehicle lands (µs)."""
    blind_text: str
    """STATUSTEXT (253) of that landing."""

    doubt_prefix: str
    """Prefix of the STATUSTEXT (253) of an objection to arming."""
    repeats_doubts: bool
    """Whether objections to arming are repeated without a request."""
    checks_mode: bool
    """Whether the pre-arm check (SYS_STATUS) requires a mode in which arming is allowed."""
    battery_timeout_us: int
    """Time for which a battery must be low before it counts as low (µs)."""
    loiter: Mode
    """The mode that NAV_LOITER_UNLIM (17) enters."""
    repositioning: Mode
    """The mode in which DO_REPOSITION (192) moves the vehicle."""
    fence_rules: Rules
    """Conditions of a fence breach, and the action that follows."""

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        ...

    def custom_mode(self, mode: Mode) -> int:
        """Return HEARTBEAT.custom_mode."""
        ...

    def base_mode(self, mode: Mode) -> int:
        """Return HEARTBEAT.base_mode without the armed bit."""
        ...

    def split(self, custom_mode: int, /) -> tuple[int, int]:
        """Return ``custom_mode`` as the two parameters of DO_SET_MODE."""
        ...

    def requested(self, main: int, sub: int, /) -> Mode | None:
        """Return the mode that parameters 2 and 3 of DO_SET_MODE (176) request, or None if unknown."""
        ...

    def armable_mode(self, mode: Mode, /) -> bool:
        """Return whether arming is allowed in ``mode``."""
        ...

    def arming_refusal(self, status: Status) -> str | None:
        """Return the reason against arming now, or None."""
        ...

    def mode_refusal(self, mode: Mode, status: Status) -> CommandRefusal | None:
        """Return the reason against entering ``mode`` now, or None."""
        ...

    def battery_condition(self, charge: Charge, /) -> BatteryCondition:
        """Return the severity of the battery's state."""
        ...

    def takeoff(
        self, altitude: float, relative: bool | None, ground: float, status: Status, /
    ) -> Takeoff | CommandRefusal:
        """Decide on NAV_TAKEOFF (22) to ``altitude`` (m; NaN if not given).

        ``altitude`` is above home if ``relative`` is True, above mean sea level if False; ``relative`` is
        None if the message has no frame or another one. ``ground``: home's altitude above mean sea level
        (m).
        """
        ...

    def read(self, message: SetpointLocal, here: Pose) -> Reading:
        """Interpret a set-point; ``here`` resolves offsets and body axes."""
        ...

    def read_attitude(self, message: SetpointAttitude, /) -> Reading:
        """Interpret an attitude and a thrust."""
        ...

    def steering_refusal(self, status: Status) -> str | None:
        """Return the reason against following a good set-point now, or None.

        An empty text means that the set-point is ignored without a complaint.
        """
        ...

    def timeout(self, setpoint: Setpoint, /) -> int | None:
        """Return how long (µs) ``setpoint`` is followed without a successor; None for no limit."""
        ...
