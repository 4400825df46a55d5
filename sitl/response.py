"""How a real firmware and its airframe lag behind the reference that ``shaper`` makes.

    reference → (ArduPilot) a consistent trajectory → position and velocity loops, tilt, drag → motion

Each arrow is a ``Stage``: gains that the firmware documents as its defaults, on a point mass with linear drag
whose thrust comes late. Only drag and lag are fitted, to recorded flights: ``tools/benchmarks/response.py``
does that, and says how well they hold where they were not fitted.
"""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

from mavlink_bridge.messages import Vector
from sitl.setpoints import ZERO

ResponseName = Literal["exact", "firmware"]

Motion = tuple[Vector, Vector, Vector]
"""Position (m), velocity (m/s), acceleration (m/s²), in one inertial frame."""


class Loop(NamedTuple):
    """Gains of a cascade: it wants the velocity given + position · error, and asks for the acceleration given
    + velocity · error + integral · ∫ error."""

    position: float  # 1/s
    velocity: float  # 1/s
    integral: float = 0.0  # 1/s²


class Stage(NamedTuple):
    """Cascades, and the point mass that they act on."""

    level: Loop
    vertical: Loop
    drag: float = 0.0  # 1/s, over mass; the loops learn of it through their integrals alone
    lag: float = 0.0  # s, time constant with which thrust follows: attitude loop, motors


RESPONSES: Final[dict[str, tuple[Stage, ...]]] = {
    "ardupilot": (
        # A stream without acceleration contradicts itself in every curve. GUIDED chases it by a law of this
        # form, the second gain PSC_JERK_* over WPNAV_ACCEL or WPNAV_ACCEL_Z and the first half of that, and
        # flies the chase; a stream that agrees with itself goes through unchanged.
        Stage(Loop(1.0, 2.0), Loop(2.5, 5.0)),
        # PSC_POSXY_P, PSC_VELXY_P, PSC_VELXY_I; PSC_POSZ_P, PSC_VELZ_P, and PSC_ACCZ_I for the integral.
        Stage(Loop(1.0, 2.0, 1.0), Loop(1.0, 5.0, 1.0), drag=0.398, lag=0.195),
    ),
    # MPC_XY_P, MPC_XY_VEL_P_ACC, MPC_XY_VEL_I_ACC; MPC_Z_P, MPC_Z_VEL_P_ACC, MPC_Z_VEL_I_ACC. The lag stands
    # for MPC_XY_VEL_D_ACC too.
    "px4": (Stage(Loop(0.95, 1.8, 0.4), Loop(1.0, 4.0, 2.0), drag=1.141, lag=0.238),),
}


class Axis(NamedTuple):
    """A point mass on one axis; ``thrust`` is its acceleration but for drag, ``learnt`` the integral's part
    of what is asked for."""

    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0
    thrust: float = 0.0
    learnt: float = 0.0


class Follower:
    """Three axes in one stage; ``motion`` is where they are."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._loops = stage.level, stage.level, stage.vertical
        self._axes = [Axis()] * 3
        self.motion: Motion = (ZERO, ZERO, ZERO)

    def relocate(self, position: Vector, velocity: Vector) -> None:
        """It is here, and goes on from here with what it has learnt."""
        pairs = zip(self._axes, position, velocity, strict=True)
        self._place([axis._replace(position=x, velocity=v) for axis, x, v in pairs])

    def restart(self, position: Vector) -> None:
        """Rest at ``position``, with nothing learnt."""
        self._place([Axis(x) for x in position])

    def advance(self, wanted: Motion, dt: float) -> None:
        """Move by ``dt`` seconds after ``wanted``, which is valid at the end of them."""
        lag = self._stage.lag
        share = -math.expm1(-dt / lag) if lag else 1.0
        targets = zip(self._loops, self._axes, *wanted, strict=True)
        self._place([self._moved(loop, axis, x, v, a, share, dt) for loop, axis, x, v, a in targets])

    def _moved(
        self, loop: Loop, axis: Axis, goal: float, speed: float, push: float, share: float, dt: float
    ) -> Axis:
        x, v, _, thrust, learnt = axis
        gain, damping, integral = loop
        # The gaps at the beginning of the step, as the point mass is there.
        gap, slip = goal - speed * dt + 0.5 * push * dt * dt - x, speed - push * dt - v
        error = gain * gap + slip
        learnt += integral * error * dt
        thrust += share * (push + damping * error + learnt - thrust)
        a = thrust - self._stage.drag * v
        return Axis(x + v * dt + 0.5 * a * dt * dt, v + a * dt, a, thrust, learnt)

    def _place(self, axes: list[Axis]) -> None:
        self._axes = axes
        north, east, down = axes
        self.motion = (
            (north.position, east.position, down.position),
            (north.velocity, east.velocity, down.velocity),
            (north.acceleration, east.acceleration, down.acceleration),
        )


class Response:
    """Followers in a row, each after the motion of the one before: where a vehicle is when it is asked to be
    somewhere."""

    def __init__(self, stages: tuple[Stage, ...]) -> None:
        self._followers = [Follower(stage) for stage in stages]

    @property
    def motion(self) -> Motion:
        """What is flown."""
        return self._followers[-1].motion

    def restart(self, position: Vector) -> None:
        """Rest at ``position``."""
        for follower in self._followers:
            follower.restart(position)

    def relocate(self, position: Vector, velocity: Vector) -> None:
        """The frame has slipped: it is here, and goes on from here."""
        for follower in self._followers:
            follower.relocate(position, velocity)

    def advance(self, wanted: Motion, dt: float) -> None:
        """Move by ``dt`` seconds after ``wanted``, which is valid at the end of them."""
        for follower in self._followers:
            follower.advance(wanted, dt)
            wanted = follower.motion
