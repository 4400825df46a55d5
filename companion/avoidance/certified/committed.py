"""Committed plans: integer trajectories on absolute knots that end at rest, so each stays valid for ever.

With positions in units of ½ A dt² and velocities in A dt (A = 1 mm/s²; see ``mavlink_bridge.wire.plan``) the
motion over a knot is p' = p + 2v + a, v' = v + a, and the segment between is the quadratic Bézier curve with
the control points p, p + v, p'. Advancing by a knot, coming to rest, and decoding on the receiver's side are
all exact in integers.
"""

from __future__ import annotations

from itertools import chain
from math import sqrt

import numpy as np
import numpy.typing as npt

from companion.errors import CertificateError
from companion.values.compiled import BOOL, FLOAT, INT, VOID, array, kernel, output, part, several
from companion.values.horizon import Array, Horizon
from mavlink_bridge.wire.plan import Integers, WirePlan, quantise

_MM = 1e-3


def resting(
    epoch: int, dt: int, steps: int, position: npt.ArrayLike, origin: int, *, column: bool = False
) -> WirePlan:
    """Return the plan to hold ``position`` (3,), m (rounded to the wire), from ``epoch`` (µs) on.

    ``column``: the vehicle may be at any height.
    """
    plan = quantise(epoch, dt, position, np.zeros(3), np.zeros((steps, 3)), origin)
    return plan._replace(column=column)


def rests(plan: WirePlan) -> bool:
    """Return whether the plan ends exactly at rest."""
    return not any(map(sum, zip(plan.velocity, *plan.accelerations, strict=True)))


def carried_on(plan: WirePlan, knots: int) -> WirePlan:
    """Return the same motion from ``knots`` (≥ 0) later on, with as many knots, filled with rest at its end.

    Raises CertificateError for a plan that does not end at rest.
    """
    if not rests(plan):
        raise CertificateError("a plan that does not end at rest cannot be carried on")
    steps = len(plan.accelerations)
    later = plan.shifted(min(knots, steps))
    rest = ((0, 0, 0),) * (steps - len(later.accelerations))
    return later._replace(epoch=plan.epoch + knots * plan.dt, accelerations=later.accelerations + rest)


def committed(start: WirePlan, accelerations: Array) -> WirePlan:
    """Return the plan from the state that ``start`` begins with, with ``accelerations`` (n, 3), m/s².

    They are rounded to the wire; the last one is replaced by the one that brings the plan to rest exactly.
    Raises CertificateError if one is not finite.
    """
    return committed_with_controls(start, accelerations)[0]


def committed_with_controls(start: WirePlan, accelerations: Array) -> tuple[WirePlan, Array]:
    """Return the plan of ``committed`` and its ``controls``."""
    rounded: npt.NDArray[np.int64] = np.empty(accelerations.shape, np.int64)
    points = np.empty((len(accelerations), 3, 3))
    state = start.position, start.velocity
    if not _rounded(*state, np.ascontiguousarray(accelerations), _metre(start), rounded, points):
        raise CertificateError("an acceleration is not finite")
    return with_accelerations(start, rounded), points


def with_accelerations(start: WirePlan, units: npt.NDArray[np.int64]) -> WirePlan:
    """Return the plan from the state that ``start`` begins with; ``units`` (n, 3): of the wire, mm/s²."""
    x, y, z = units.T.tolist()
    knots: tuple[Integers, ...] = tuple(zip(x, y, z, strict=True))
    epoch, dt, position, velocity, _, origin, column = start
    return WirePlan(epoch, dt, position, velocity, knots, origin, column)


def rounding(steps: int, dt: int) -> Array:
    """Return upper bounds (n, 3), m, on how far rounding moves the control points of a plan.

    Each acceleration but the last is off by half a unit at most on each axis. The last one cancels the sum of
    these errors, so the bounds hold with it, too.
    """
    n = np.arange(steps)
    units = np.stack([n**2, n**2 + n, (n + 1) ** 2], axis=1)
    result: Array = 0.25 * sqrt(3.0) * _MM * (dt * 1e-6) ** 2 * units
    return result


def controls(plan: WirePlan) -> Array:
    """Return control points (n, 3, 3) of the segments, m, fleet-local ENU."""
    return _controls_of(plan, accelerations_of(plan))


def controls_and_accelerations(plan: WirePlan) -> tuple[Array, Array]:
    """Return control points (n, 3, 3), m, and accelerations (n, 3), m/s², of the segments."""
    units = accelerations_of(plan)
    found: Array = units.astype(np.float64) * _MM
    return _controls_of(plan, units), found


def _controls_of(plan: WirePlan, accelerations: npt.NDArray[np.int64]) -> Array:
    points = np.empty((len(accelerations), 3, 3))
    _controls(plan.position, plan.velocity, accelerations, _metre(plan), points)
    return points


def _metre(plan: WirePlan) -> float:
    """Return the unit of positions, m."""
    return 0.5 * _MM * (plan.dt * 1e-6) ** 2


def horizon_of(plan: WirePlan, following: WirePlan | None = None, after: int = 0) -> Horizon:
    """Return the plan as a horizon, in metres; beyond its end it rests.

    If a plan is ``following`` after a number of knots, the horizon goes on with that plan.
    """
    first = len(plan.accelerations) if following is None else after
    last = 0 if following is None else len(following.accelerations) + 1
    knots = np.empty((first + max(last, 1), 9))
    seconds = plan.dt * 1e-6
    units = 0.5 * _MM * seconds**2, _MM * seconds
    _knots(plan.position, plan.velocity, _array(plan.accelerations[:first]), *units, knots[: first + 1])
    if following is not None:
        _knots(following.position, following.velocity, accelerations_of(following), *units, knots[first:])
    return Horizon(plan.epoch, plan.dt, knots)


def rest_time(horizon: Horizon) -> int:
    """Return the time (µs) of the knot from which the horizon of a plan that ends at rest is at rest."""
    moves = np.flatnonzero(horizon.knots[:, 3:].any(axis=1))
    return horizon.epoch + horizon.dt * (int(moves[-1]) + 1 if len(moves) else 0)


def accelerations_of(plan: WirePlan) -> npt.NDArray[np.int64]:
    """Return the accelerations (n, 3) in units of the wire."""
    return _array(plan.accelerations)


def _array(accelerations: tuple[Integers, ...]) -> npt.NDArray[np.int64]:
    return np.fromiter(chain.from_iterable(accelerations), np.int64, 3 * len(accelerations)).reshape(-1, 3)


@part
def _write_controls(
    position: Integers, velocity: Integers, accelerations: npt.NDArray[np.int64], unit: float, points: Array
) -> None:
    """Write the control points (n, 3, 3) of a plan in units of the wire; ``unit``: that of positions (m)."""
    for axis in range(3):
        p, v = position[axis], velocity[axis]
        for k in range(len(accelerations)):
            a = accelerations[k, axis]
            points[k, 0, axis], points[k, 1, axis], points[k, 2, axis] = (
                p * unit,
                (p + v) * unit,
                (p + 2 * v + a) * unit,
            )
            p, v = p + 2 * v + a, v + a


@kernel(BOOL, *[several(3, INT)] * 2, array(2), FLOAT, output(2, INT), output(3))
def _rounded(
    position: Integers,
    velocity: Integers,
    accelerations: Array,
    unit: float,
    rounded: npt.NDArray[np.int64],
    points: Array,
) -> bool:
    """Write the ``rounded`` accelerations (n, 3) that end at rest, and the control points ``points``.

    Returned is whether all are finite; otherwise the result is incomplete.
    """
    n = len(accelerations)
    for axis in range(3):
        left = -velocity[axis]
        for k in range(n):
            if not np.isfinite(accelerations[k, axis]):
                return False
            rounded[k, axis] = left if k == n - 1 else int(np.rint(accelerations[k, axis] / _MM))
            left -= rounded[k, axis]
    _write_controls(position, velocity, rounded, unit, points)
    return True


@kernel(VOID, *[several(3, INT)] * 2, array(2, INT), FLOAT, output(3))
def _controls(
    position: Integers, velocity: Integers, accelerations: npt.NDArray[np.int64], unit: float, points: Array
) -> None:
    """Write the control points of a plan, see ``_write_controls``."""
    _write_controls(position, velocity, accelerations, unit, points)


@kernel(VOID, *[several(3, INT)] * 2, array(2, INT), FLOAT, FLOAT, output(2))
def _knots(
    position: Integers,
    velocity: Integers,
    accelerations: npt.NDArray[np.int64],
    metre: float,
    speed: float,
    knots: Array,
) -> None:
    """Write the ``knots`` (n + 1, 9) of a ``Horizon``; ``metre`` and ``speed`` (m, m/s) are the units."""
    n = len(accelerations)
    for axis in range(3):
        p, v = position[axis], velocity[axis]
        for k in range(n + 1):
            a = accelerations[k, axis] if k < n else 0
            knots[k, axis], knots[k, 3 + axis], knots[k, 6 + axis] = p * metre, v * speed, a * 1e-3
            p, v = p + 2 * v + a, v + a
