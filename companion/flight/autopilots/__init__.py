"""Differences between PX4 and ArduPilot: modes, order of take-off steps, and set-point fields."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from mavlink_bridge.messages import Heartbeat

Params = tuple[float, float, float, float, float, float, float]


class Step(Enum):
    """One step of the take-off; the order of the steps depends on the autopilot."""

    MODE = "guided mode"
    ARM = "arm"
    TAKEOFF = "take-off"


class Shaping(NamedTuple):
    """Dynamics of a trajectory that follows the set-points.

    The acceleration of the trajectory changes by at most ``jerk`` (m/s³). Velocity errors are corrected with
    the gain ``velocity`` (1/s), position errors with the gain ``position`` (1/s).
    """

    jerk: float
    position: float
    velocity: float


class Inverse(NamedTuple):
    """Constants of a loop whose set-points are moved aside for the vehicle to be on its plan.

    ``integral`` (1/s²): gain of the integral of the velocity loop; ``lag_us``: lag of the attitude (µs).
    """

    integral: float
    lag_us: int


class Loop(NamedTuple):
    """Default gains of an autopilot's horizontal position loop.

    With v_r and a_r the velocity and the acceleration of the set-point, the loop asks for the velocity v_r +
    ``position`` (1/s) · position error, and for the acceleration a_r + ``velocity`` (1/s) · velocity error.
    ``slew`` (m/s³): largest rate of change of the compensation that is added to a_r. ``shaping``: dynamics of
    the trajectory with which the autopilot follows set-points; None if it uses no trajectory. ``offset_s``:
    time constant (s) of the estimated velocity offset, which the velocity set-point compensates; 0: no
    compensation. ``lead_us``: lag of the attitude (µs), by which the acceleration of set-points is sent
    ahead. ``pull`` (1/s): rate at which the velocity set-point corrects the position in addition to the loop.

    ``derivative``: gain of the derivative of the measured velocity. ``inverse``: see there; None if additions
    to the acceleration of set-points take effect as they are. ``integral`` (1/s²): gain of the integral of
    the velocity error that the observer predicts. These are used with committed plans only.
    """

    position: float
    velocity: float
    slew: float
    shaping: Shaping | None = None
    offset_s: float = 0.0
    lead_us: int = 0
    pull: float = 0.0
    derivative: float = 0.0
    inverse: Inverse | None = None
    integral: float = 0.0


class Profile(NamedTuple):
    """Firmware-specific modes, parameters and gains of an autopilot.

    ``estimator_message``: the id of the message with the estimator's status. ``mode_params``: p1…p3 of
    DO_SET_MODE for the guided mode; ``setpoint_mask``: the type_mask to send.

    ``guided_custom_mode``: custom_mode of HEARTBEAT in which the vehicle follows set-points; ``guided_name``:
    the name of that mode. ``streams_first``: set-points must be streamed before the mode is granted, and
    before the pre-arm checks pass in this mode. ``takeoff_absolute``: NAV_TAKEOFF takes an altitude above
    mean sea level, not above home. ``hold_params``: p1…p3 of DO_SET_MODE for the mode in which the autopilot
    holds its position by itself; ``hold_mode`` and ``hold_name``: custom_mode and name of that mode.
    ``fallen_modes``: possible values of custom_mode after set-points were missing for too long;
    ``loss_modes``: those in which no pilot flies. ``takeoff_modes`` and ``land_modes``: the modes to which
    NAV_TAKEOFF, where it changes the mode, and NAV_LAND lead. ``loop``: how the autopilot follows set-points.
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
        """All parameters of DO_SET_MODE for the guided mode."""
        return (*self.mode_params, 0.0, 0.0, 0.0, 0.0)

    @property
    def hold_call(self) -> Params:
        """All parameters of DO_SET_MODE for the mode in which the autopilot holds its position."""
        return (*self.hold_params, 0.0, 0.0, 0.0, 0.0)


def is_guided(profile: Profile, heartbeat: Heartbeat) -> bool:
    """Return whether the vehicle's mode is the one in which it follows set-points."""
    return heartbeat.custom_mode == profile.guided_custom_mode
