"""Committed plans to draw from, and curves to look at: for the laws of certified separation."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from companion.avoidance.certified.committed import carried_on, committed, controls
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import Integers, WirePlan, quantise

DT = 200_000
"""µs, not the default: a round number of the units of the wire."""
STEPS = 16
EPOCH = 1_767_225_600_000_000
"""µs, a whole number of knots and of every length of an epoch here."""


def _triple(most: int) -> st.SearchStrategy[Integers]:
    one = st.integers(-most, most)
    return st.tuples(one, one, one)


def _ended(plan: WirePlan) -> WirePlan:
    """With one more knot, which brings it to rest."""
    last = tuple(-v - sum(axis) for v, *axis in zip(plan.velocity, *plan.accelerations, strict=True))
    return plan._replace(accelerations=(*plan.accelerations, last))


resting_plans = st.builds(
    WirePlan,
    st.integers(0, 2**35).map(lambda knot: knot * DT),
    st.sampled_from([DT, 4, 100_000, 262_140]),
    _triple(2**30),
    _triple(2_700),
    st.lists(_triple(2_000), max_size=STEPS - 1).map(tuple),
    st.integers(0, 255),
).map(_ended)
"""Any plan that ends at rest and fits the wire."""


def random_plan(
    rng: np.random.Generator, position: Array, *, speed: float = 2.0, acceleration: float = 0.7
) -> WirePlan:
    """One that swings about and comes to rest, from about ``position`` (3,) m. With these bounds (m/s, m/s²)
    it asks for less than 2 m/s²."""
    velocity = rng.uniform(-speed, speed, 3)
    a = rng.uniform(-acceleration, acceleration, (STEPS, 3))
    a -= (a.sum(axis=0) + velocity / (1e-6 * DT)) / STEPS
    start = quantise(EPOCH, DT, position, velocity, np.zeros((STEPS, 3)), 7)
    return committed(start, a)


def later(plan: WirePlan, knots: int = 1) -> Array:
    """Its control points (n, 3, 3) m from ``knots`` later on."""
    return controls(carried_on(plan, knots))


def curves(points: Array, count: int = 21) -> Array:
    """Places (..., count, 3) on the segments with control points (..., 3, 3), both ends among them."""
    s = np.linspace(0.0, 1.0, count)
    weights = np.stack([(1.0 - s) ** 2, 2.0 * s * (1.0 - s), s**2], axis=1)
    result: Array = weights @ points
    return result
