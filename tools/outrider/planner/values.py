"""Values that go into and come out of a planner: metres, seconds and radians, east-north-up."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from companion.values.horizon import Array, Horizon, roll_out
from outrider.arguments import checked, number, system_id
from outrider.errors import InputError

_ZERO = (0.0, 0.0, 0.0)


def microseconds(name: str, seconds: float) -> int:
    """Return ``seconds`` as whole µs; raise InputError for what is no finite time."""
    return round(1e6 * number(name, seconds, "s"))


class Motion(NamedTuple):
    """Motion at one time: ``position`` (3,) m, ``velocity`` (3,) m/s, ``acceleration`` (3,) m/s²; ENU."""

    position: Array
    velocity: Array
    acceleration: Array


class Plan:
    """Trajectory with constant acceleration between knots; before and after them the velocity is constant."""

    def __init__(self, horizon: Horizon) -> None:
        self._horizon = horizon

    @classmethod
    def of(
        cls, time: float, step: float, position: ArrayLike, velocity: ArrayLike, accelerations: ArrayLike
    ) -> Self:
        """Return the plan from a state at ``time`` (s) with ``accelerations`` (n, 3), m/s², one per ``step``.

        ``position`` (3,) m, ``velocity`` (3,) m/s, ENU; ``step`` in s. Raises InputError.
        """
        dt = microseconds("step", number("step", step, "s", least=1e-6))
        return cls(
            roll_out(
                microseconds("time", time),
                dt,
                checked("position", position, (3,), "m"),
                checked("velocity", velocity, (3,), "m/s"),
                checked("accelerations", accelerations, ("n", 3), "m/s²"),
            )
        )

    @property
    def horizon(self) -> Horizon:
        """The trajectory in the planner's own form, with times in µs."""
        return self._horizon

    @cached_property
    def times(self) -> Array:
        """Times (n + 1,) of the knots, s, on the clock of the caller."""
        epoch, dt, knots = self._horizon
        return np.asarray(1e-6 * (epoch + dt * np.arange(len(knots))), dtype=np.float64)

    @property
    def positions(self) -> Array:
        """Positions (n + 1, 3) at the knots, m, ENU."""
        return self._horizon.knots[:, 0:3]

    @property
    def velocities(self) -> Array:
        """Velocities (n + 1, 3) at the knots, m/s, ENU."""
        return self._horizon.knots[:, 3:6]

    @property
    def accelerations(self) -> Array:
        """Accelerations (n, 3) between the knots, m/s², ENU."""
        return self._horizon.knots[:-1, 6:9]

    def at(self, time: float) -> Motion:
        """Return the planned motion at ``time`` (s)."""
        return Motion(*self._horizon.at(microseconds("time", time)))

    def __repr__(self) -> str:
        return f"Plan({self.times[0]:.3f} s to {self.times[-1]:.3f} s, {len(self.times)} knots)"


@dataclass(frozen=True, eq=False)
class Neighbour:
    """Another vehicle.

    ``id``: 1 to 255. ``position`` (3,) m, ``velocity`` (3,) m/s, ENU, as measured at ``time`` (s, on the
    caller's clock; None: at the step). ``plan``: the newest plan that it shares, if any; without one, or
    more than 1 m beside it, the neighbour is predicted at constant velocity. Raises InputError for wrong
    shapes and values that are not finite.
    """

    id: int
    position: ArrayLike
    velocity: ArrayLike = _ZERO
    plan: Plan | None = None
    time: float | None = None

    def __post_init__(self) -> None:
        name = f"neighbour {self.id!r}"
        system_id("id of a neighbour", self.id)
        object.__setattr__(self, "position", checked(f"position of {name}", self.position, (3,), "m"))
        object.__setattr__(self, "velocity", checked(f"velocity of {name}", self.velocity, (3,), "m/s"))
        if self.plan is not None and not isinstance(self.plan, Plan):
            raise InputError(f"plan of {name}: is a {type(self.plan).__name__}; allowed: a Plan, or None")
        if self.time is not None:
            number(f"time of {name}", self.time, "s")


@dataclass(frozen=True, eq=False)
class Obstacle:
    """Ball, or with ``upright`` a vertical cylinder without ends, that moves at constant ``velocity``.

    ``position`` (3,) of its centre, m, at the step; ``radius``, m; ``velocity`` (3,), m/s; ENU. Raises
    InputError for wrong shapes and values that are not finite.
    """

    position: ArrayLike
    radius: float
    velocity: ArrayLike = _ZERO
    upright: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", checked("position of an obstacle", self.position, (3,), "m"))
        object.__setattr__(self, "velocity", checked("velocity of an obstacle", self.velocity, (3,), "m/s"))
        number("radius of an obstacle", self.radius, "m", least=0.0)
        if not isinstance(self.upright, bool | np.bool_):
            raise InputError(f"upright of an obstacle: is {self.upright!r}; allowed: True or False")


@dataclass(frozen=True, eq=False)
class Target:
    """What the vehicles escort: ``position`` (3,) m, ``velocity`` (3,) m/s, ENU; ``turn_rate``, rad/s.

    The turn rate is that of its course, counter-clockwise from above. Raises InputError for wrong shapes and
    values that are not finite.
    """

    position: ArrayLike
    velocity: ArrayLike = _ZERO
    turn_rate: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", checked("position of the target", self.position, (3,), "m"))
        object.__setattr__(self, "velocity", checked("velocity of the target", self.velocity, (3,), "m/s"))
        number("turn_rate of the target", self.turn_rate, "rad/s")


@dataclass(frozen=True, eq=False)
class Setpoint:
    """What the vehicle should follow: position, velocity and acceleration (3,), ENU; ``yaw``, ``yaw_rate``.

    SI units; the yaw (rad) and its rate (rad/s) are counter-clockwise from east. It is the motion of the plan
    at ``time`` (s): ``setpoint_lead_us`` after the step.
    """

    time: float
    position: Array
    velocity: Array
    acceleration: Array
    yaw: float
    yaw_rate: float


@dataclass(frozen=True, eq=False)
class Step:
    """Result of one step.

    ``plan`` and ``setpoint``: what is flown; None while nothing is (with committed plans: until the vehicle
    has rested for half a second), and the vehicle should hold its position. ``state``: "fresh plan", "held
    plan" (the solver failed, the old plan continues) or "brake and hover". ``packets``: bytes for all other
    planners, with committed plans only. ``plan_ms``: wall time of a plan made in this step; None without one.
    """

    plan: Plan | None
    setpoint: Setpoint | None
    state: str
    packets: tuple[bytes, ...] = ()
    plan_ms: float | None = None
