"""What ArduPilot and PX4 do differently, behind one small interface.

The commander knows when something is asked; a flavour knows whether it is allowed, how its modes are numbered
and how it reads a set-point. Everything here is pure: ``Status`` in, verdicts out. Sources: ArduCopter 4.6.3
and PX4 1.16.1 as flown and measured.
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

# MAV_RESULT
ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
DENIED: Final = 2
UNSUPPORTED: Final = 3
FAILED: Final = 4

# MAV_MODE_FLAG
CUSTOM: Final = 0x01
AUTO: Final = 0x04
GUIDED_FLAG: Final = 0x08
STABILIZED: Final = 0x10
MANUAL: Final = 0x40
ARMED: Final = 0x80


class Mode(Enum):
    """What a mode means; a flavour gives it its number."""

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
"""The mode that follows, by what the settings call it."""


def limit(setting: float | None, usual: float) -> float:
    """A limit (m): the ``usual`` one if nothing is set, none if it is 0."""
    return (usual if setting is None else setting) or math.inf


class Status(NamedTuple):
    """What a decision may depend on. ``height`` (m) above home. ``stream_age`` and ``stream_gap`` (s): since
    the last usable set-point, and between it and the one before it (0 when it is the first of its stream).
    ``items``, ``takes_off``: how many items the mission has, and whether it begins with a takeoff; told when
    its mode is asked for."""

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


class Worry(NamedTuple):
    """How bad it is about a battery (0: not at all), in a word, and the mode that follows, if any."""

    level: int
    word: str = ""
    mode: Mode | None = None


class Takeoff(NamedTuple):
    """Climb to ``height`` (m above home), in this mode."""

    height: float
    mode: Mode


class Denial(NamedTuple):
    """Not now or not at all: a MAV_RESULT, and why."""

    result: int
    reason: str


class Flavour(Protocol):
    """One firmware's dialect and rules."""

    autopilot: int
    """MAV_AUTOPILOT."""
    boot_mode: Mode
    stream_first: bool
    """Whether set-points count before GUIDED is entered, and can take the vehicle off the ground in it."""
    stops: bool
    """Whether a set-point in a frame that it does not know means *stop*; else it is refused."""
    reports_ekf: bool
    """Whether EKF_STATUS_REPORT (193) is streamed."""
    echoes_yaw: bool
    """Whether POSITION_TARGET_LOCAL_NED (85) comes back with yaw."""
    shortest_interval: int
    """µs; SET_MESSAGE_INTERVAL (511) refuses less."""
    bytewise: bool
    """Whether integer parameters are sent as their bytes (PARAM_ENCODE_BYTEWISE)."""
    groups_streams: bool
    """Whether REQUEST_DATA_STREAM (66) is obeyed."""
    after_takeoff: Mode
    after_landing: Mode
    keeps_choice: bool
    """Whether the last mode that was chosen and may be armed in comes back when it is disarmed, and GUIDED
    when its set-points do."""
    after_return: Mode
    after_mission: Mode
    """The mode when the last item is done."""
    set_mode_ack: int
    """The command that COMMAND_ACK (77) names after SET_MODE (11)."""
    first_item: int
    """The first item of a mission that is flown: ArduPilot keeps home as item 0."""
    start_arms: bool
    """Whether MISSION_START (300) arms."""
    after_loss: Mode
    """The mode when set-points time out."""
    coasting: float
    """s; so long its filter has a position without GPS."""
    blind_patience: int
    """µs; flying without a position for so long, it lands."""
    blind_text: str
    """STATUSTEXT (253) of that."""

    doubt_prefix: str
    """STATUSTEXT (253) of what speaks against arming begins so."""
    repeats_doubts: bool
    """Whether it says them without being asked."""
    checks_mode: bool
    """Whether its pre-arm check (SYS_STATUS) asks for a mode in which it may be armed."""
    battery_patience: int
    """µs; a battery counts as low when it has been so for as long."""
    loiter: Mode
    """Of NAV_LOITER_UNLIM (17)."""
    repositioning: Mode
    """In which DO_REPOSITION (192) moves it."""
    fence_rules: Rules
    """When a fence is breached, and what follows."""

    def configure(self, config: AutopilotConfig) -> None:
        """Other settings from now on."""
        ...

    def custom_mode(self, mode: Mode) -> int:
        """HEARTBEAT.custom_mode."""
        ...

    def base_mode(self, mode: Mode) -> int:
        """HEARTBEAT.base_mode without the armed bit."""
        ...

    def split(self, custom_mode: int, /) -> tuple[int, int]:
        """``custom_mode`` as the two parameters of DO_SET_MODE."""
        ...

    def requested(self, main: int, sub: int, /) -> Mode | None:
        """The mode that DO_SET_MODE (176) asks for by parameters 2 and 3, None when there is none such."""
        ...

    def armable_mode(self, mode: Mode, /) -> bool:
        """Whether it can be armed in this mode."""
        ...

    def arming_denial(self, status: Status) -> str | None:
        """Why it must not arm now."""
        ...

    def mode_denial(self, mode: Mode, status: Status) -> Denial | None:
        """Why ``mode`` must not be entered now."""
        ...

    def worry(self, charge: Charge, /) -> Worry:
        """How bad it is about the battery."""
        ...

    def takeoff(
        self, altitude: float, relative: bool | None, ground: float, status: Status, /
    ) -> Takeoff | Denial:
        """NAV_TAKEOFF (22) to ``altitude`` (m; NaN when not given), above home if ``relative``, above mean
        sea level if not, None when the message has no frame. ``ground``: home's altitude above mean sea level
        (m)."""
        ...

    def read(self, message: SetpointLocal, here: Pose) -> Reading:
        """What a set-point asks for; offsets and body axes are resolved with ``here``."""
        ...

    def read_attitude(self, message: SetpointAttitude, /) -> Reading:
        """What an attitude and a thrust ask for."""
        ...

    def steering_denial(self, status: Status) -> str | None:
        """Why a good set-point is not followed now; an empty text when that is no cause for complaint."""
        ...

    def timeout(self, setpoint: Setpoint, /) -> int | None:
        """How long (µs) it is followed when no other comes; None for ever."""
        ...
