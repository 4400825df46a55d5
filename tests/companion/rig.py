"""What the tests of the companion share: strategies, obstacles, scenes, and point masses that fly their own
plans.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from companion.avoidance.field.methods import Scene
from companion.avoidance.field.planner import Plan, Planner, standing
from companion.config import CompanionConfig
from companion.surfaces import Circle, Surface
from companion.values.horizon import Array, Horizon
from companion.values.obstacles import Obstacles

LAWS = settings(deadline=None, max_examples=60)
QUICK = settings(deadline=None, max_examples=25)
"""Without a deadline: a machine under load must not fail a law."""

ZERO = np.zeros(3)
STRONG = np.array([10.0, 0.0, 0.0])
TARGET = np.array([8.0, 0.0, 0.0])
CIRCLE = Circle()

_STEPS, _DT = 16, 0.1
"""Predicted positions, and s from one to the next."""


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def vectors(bound: float) -> st.SearchStrategy[Array]:
    return st.tuples(*[numbers(-bound, bound)] * 3).map(np.array)


def rotations() -> st.SearchStrategy[Array]:
    """Proper rotations (3, 3), from quaternions that are not too short."""
    quaternions = st.tuples(*[numbers(-1.0, 1.0)] * 4).map(np.array)
    return quaternions.filter(lambda q: float(q @ q) > 0.01).map(_rotation)


def _rotation(q: Array) -> Array:
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def obstacles(positions: Any, velocities: Any = None, *, steps: int = _STEPS, dt: float = _DT) -> Obstacles:
    """Obstacles at ``positions`` (M, 3) now, at constant velocity, with the paper's distances."""
    here = np.asarray(positions, dtype=float).reshape(-1, 3)
    speed = np.zeros_like(here) if velocities is None else np.asarray(velocities, dtype=float).reshape(-1, 3)
    ahead = dt * np.arange(steps)[:, None]
    count = len(here)
    return Obstacles(
        tuple(range(1, count + 1)),
        here[:, None] + ahead * speed[:, None],
        np.full(count, 0.5),
        np.full(count, 3.0),
    )


def scene(
    position: Array,
    others: Obstacles,
    gradient: Array = STRONG,
    velocity: Array = ZERO,
    *,
    surface: Surface | None = CIRCLE,
    target: Array = TARGET,
    target_velocity: Array = ZERO,
) -> Scene:
    """On the way to the surface around a target; without a surface to a goal of its own, on the circle."""
    prediction = position + _DT * np.arange(_STEPS)[:, None] * velocity
    carried = _DT * _STEPS * target_velocity
    place = target + (CIRCLE if surface is None else surface).nearest(position - target)
    return Scene(
        position,
        velocity,
        prediction,
        place + carried,
        target_velocity,
        place - position,
        target,
        others,
        gradient,
        target + carried,
        surface,
    )


class MadePlan(NamedTuple):
    """One plan of a flight: who made it, from which state, and what came out."""

    time: int
    vehicle: int
    planner: Planner
    position: Array
    velocity: Array
    plan: Plan


def fly(
    config: CompanionConfig,
    starts: Array,
    goals: Array,
    seconds: float,
    period: int = 100_000,
    still: int = 0,
) -> Iterator[MadePlan]:
    """Point masses that fly exactly what they plan and know each other's last horizons, from ``starts`` to
    ``goals`` (K, 3); the last ``still`` of them never move."""
    steps, dt = config.horizon.steps + 1, config.horizon.dt_us
    count = len(starts)
    planners = [Planner(config) for _ in range(count)]
    horizons = []
    for start in starts:
        knots = np.zeros((steps + 1, 9))
        knots[:, 0:3] = start
        horizons.append(Horizon(0, dt, knots))
    field = config.field
    for now in range(0, round(seconds * 1e6), period):
        predictions = np.array([h.positions(now, steps, dt) for h in horizons])
        fresh = []
        for k in range(count - still):
            others = [j for j in range(count) if j != k]
            seen = Obstacles(
                tuple(others),
                predictions[others],
                np.full(count - 1, field.d_min),
                np.full(count - 1, field.d_safe),
            )
            motion = horizons[k].at(now)
            aim = standing(goals[k], ZERO)
            plan = planners[k].plan(now, motion.position, motion.velocity, predictions[k], aim, seen)
            fresh.append(plan.horizon)
            yield MadePlan(now, k, planners[k], motion.position, motion.velocity, plan)
        horizons[: len(fresh)] = fresh


def ring(count: int, radius: float, height: float, seed: int = 1) -> Array:
    """Places (count, 3) on a circle, jittered by decimetres."""
    angle = 2.0 * np.pi * np.arange(count) / count
    places = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, height)])
    return np.asarray(places + np.random.default_rng(seed).uniform(-0.2, 0.2, (count, 3)))
