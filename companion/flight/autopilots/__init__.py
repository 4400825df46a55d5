"""What PX4 and ArduPilot want differently: modes, the order of take-off, and which set-point fields they
take."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from mavlink_bridge.messages import Heartbeat

Params = tuple[float, float, float, float, float, float, float]


class Step(Enum):
    """One stage on the way into the air; which order is the autopilot's."""

    MODE = "guided mode"
    ARM = "arm"
    TAKEOFF = "take-off"


class Shaping(NamedTuple):
    """How the trajectory follows the set-points: its acceleration changes by at most ``jerk`` (m/s³), and
    corrects its velocity at the rate ``velocity``, its position at the rate ``position`` (1/s)."""

    jerk: float
    position: float
    velocity: float


class Loop(NamedTuple):
    """Gains of an autopilot's horizontal position loop, its defaults: it asks for the velocity v_r +
    ``position`` · error (1/s), and for the acceleration a_r + ``velocity`` · its error (1/s). ``slew``: how
    fast (m/s³) what is added to a_r may change beside what plans ask for. ``shaping``: of an autopilot that
    chases set-points with a trajectory of its own. ``offset_s``: over so many seconds it is seen by how much
    the estimated velocity is off, for the velocity set-point to make up for it; 0: it does not. ``lead_us``:
    by so much (µs) the attitude is late, and the acceleration of set-points early. ``pull``: rate (1/s) at
    which the velocity set-point corrects the position beside what the loop does."""

    position: float
    velocity: float
    slew: float
    shaping: Shaping | None = None
    offset_s: float = 0.0
    lead_us: int = 0
    pull: float = 0.0


class Profile(NamedTuple):
    """An autopilot's ways. ``estimator_message``: the id of the one by which its estimator tells how it is.
    ``mode_params`` are p1…p3 of DO_SET_MODE; ``setpoint_mask`` is the type_mask to send.

    ``guided_custom_mode`` is how HEARTBEAT says that our set-points steer, in the mode ``guided_name``.
    ``streams_first``: set-points must flow before the mode is granted, and before its checks pass in it.
    ``takeoff_absolute``: NAV_TAKEOFF wants an altitude above mean sea level, not above home.
    ``hold_params``: p1…p3 of DO_SET_MODE for the mode, ``hold_mode`` and ``hold_name``, in which it stays
    where it is by itself. ``fallen_modes``: what custom_mode may be when set-points were
    missing for too long; ``loss_modes``: those of them that no pilot flies in. ``takeoff_modes`` and
    ``land_modes``: those into which NAV_TAKEOFF, where it changes the mode, and NAV_LAND lead.
    ``loop``: how it follows set-points.
    ``bytewise``: PARAM_VALUE holds the bytes of an integer parameter, not its value as a float.
    """

    name: str
    autopilot: int
    estimator_message: int
    steps: tuple[Step, ...]
    mode_params: tuple[float, float, float]
    guided_custom_mode: int
    guided_name: str
    setpoint_mask: int
    streams_first: bool
    takeoff_absolute: bool
    hold_params: tuple[float, float, float]
    hold_mode: int
    hold_name: str
    land_modes: frozenset[int]
    fallen_modes: frozenset[int] = frozenset()
    loss_modes: frozenset[int] = frozenset()
    takeoff_modes: frozenset[int] = frozenset()
    loop: Loop = Loop(1.0, 2.0, 1.0)
    bytewise: bool = False

    @property
    def mode_call(self) -> Params:
        """All parameters of DO_SET_MODE for the mode in which our set-points steer."""
        return (*self.mode_params, 0.0, 0.0, 0.0, 0.0)

    @property
    def hold_call(self) -> Params:
        """The same for the one in which it stays where it is by itself."""
        return (*self.hold_params, 0.0, 0.0, 0.0, 0.0)


def is_guided(profile: Profile, heartbeat: Heartbeat) -> bool:
    """Whether our set-points steer this vehicle."""
    return heartbeat.custom_mode == profile.guided_custom_mode
