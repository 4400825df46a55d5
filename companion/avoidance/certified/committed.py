"""Committed plans: integer trajectories on absolute knots that end at rest, so each stays valid for ever.

With positions in units of ½ A dt² and velocities in A dt (A = 1 mm/s²; see ``mavlink_bridge.wire.plan``) the
motion over a knot is p' = p + 2v + a, v' = v + a, and the segment between is the quadratic Bézier curve with
the control points p, p + v, p'. Advancing by a knot, coming to rest, and decoding on the receiver's side are
all exact in integers.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
import numpy.typing as npt

from companion.errors import CertificateError
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
    return all(v + sum(a) == 0 for v, a in zip(plan.velocity, _by_axis(plan), strict=True))


def carried_on(plan: WirePlan, knots: int) -> WirePlan:
    """Return the same motion from ``knots`` (≥ 0) later on, with as many knots, filled with rest at its end.

    Raises CertificateError for a plan that does not end at rest.
    """
    if not rests(plan):
        raise CertificateError("a plan that does not end at rest cannot be carried on")
    steps = len(plan.accelerations)
    later = plan.shifted(min(knots, steps))
    missing = steps - len(later.accelerations)
    return later._replace(
        epoch=plan.epoch + knots * plan.dt, accelerations=later.accelerations + ((0, 0, 0),) * missing
    )


def committed(start: WirePlan, accelerations: Array) -> WirePlan:
    """Return the plan from the state that ``start`` begins with, with ``accelerations`` (n, 3), m/s².

    They are rounded to the wire; the last one is replaced by the one that brings the plan to rest exactly.
    Raises CertificateError if one is not finite.
    """
    if not np.isfinite(accelerations).all():
        raise CertificateError("an acceleration is not finite")
    rounded = np.rint(accelerations / _MM).astype(np.int64)
    rounded[-1] = -np.array(start.velocity) - rounded[:-1].sum(axis=0)
    knots: tuple[Integers, ...] = tuple((x, y, z) for x, y, z in rounded.tolist())
    return start._replace(accelerations=knots)


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
    states = plan.states()
    position, velocity = states[:, 0], states[:, 1]
    points = np.stack([position[:-1], position[:-1] + velocity[:-1], position[1:]], axis=1)
    return points * (0.5 * _MM * (plan.dt * 1e-6) ** 2)


def horizon_of(plan: WirePlan) -> Horizon:
    """Return the plan as a horizon, in metres; beyond its end it rests."""
    states = plan.states()
    seconds = plan.dt * 1e-6
    knots = np.zeros((len(states), 9))
    knots[:, 0:3] = states[:, 0] * (0.5 * _MM * seconds**2)
    knots[:, 3:6] = states[:, 1] * (_MM * seconds)
    knots[:-1, 6:9] = plan.accelerations_m_s2
    return Horizon(plan.epoch, plan.dt, knots)


def rest_time(horizon: Horizon) -> int:
    """Return the time (µs) of the knot from which the horizon of a plan that ends at rest is at rest."""
    moves = np.flatnonzero(horizon.knots[:, 3:].any(axis=1))
    return horizon.epoch + horizon.dt * (int(moves[-1]) + 1 if len(moves) else 0)


def _by_axis(plan: WirePlan) -> list[list[int]]:
    return [[a[axis] for a in plan.accelerations] for axis in range(3)]
