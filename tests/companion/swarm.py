"""A swarm of point masses that fly what they plan, all at once, each by what the others planned a step
before, and the configurations in which it flies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from companion.avoidance.field.planner import Aim, Planner, standing
from companion.config import CompanionConfig
from companion.values.horizon import Array, roll_out
from companion.values.obstacles import Obstacles
from tests.companion.rig import CIRCLE, ZERO

START = 1_767_225_600_000_000
DT, STEPS = 100_000, 16
AHEAD = 1e-6 * DT * STEPS
OTHER = {"own": "own", "right": "left"}

METHODS = {
    "baseline": ("baseline",),
    "swivel": ("swivel",),
    "approach": ("approach_angle",),
    "tangential": ("tangential",),
    "both": ("swivel", "tangential"),
}
WAYS = [(name, sense) for name in METHODS for sense in OTHER if (name, sense) != ("baseline", "right")]
"""Without a method there are no senses."""


def configured(name: str, sense: str) -> CompanionConfig:
    return CompanionConfig.model_validate({"methods": METHODS[name], "turning_sense": sense})


class Swarm(NamedTuple):
    """Vehicles (K, 3) with their velocities and goals (None: they escort), the target (3,) and its velocity,
    and a ball (3,) in the way."""

    places: Array
    velocities: Array
    goals: Array | None
    target: Array
    speed: Array
    ball: Array

    def seen(self, matrix: Array, shift: Array = ZERO) -> Swarm:
        """In another frame, an image of this one."""
        goals = None if self.goals is None else self.goals @ matrix.T + shift
        return Swarm(
            self.places @ matrix.T + shift,
            self.velocities @ matrix.T,
            goals,
            matrix @ self.target + shift,
            matrix @ self.speed,
            matrix @ self.ball + shift,
        )

    def ordered(self, order: Sequence[int]) -> Swarm:
        rows = list(order)
        goals = None if self.goals is None else self.goals[rows]
        return self._replace(places=self.places[rows], velocities=self.velocities[rows], goals=goals)

    def aim(self, k: int, seconds: float, place: Array) -> Aim:
        here = self.target + seconds * self.speed
        if self.goals is not None:
            return standing(self.goals[k], here)
        end = here + AHEAD * self.speed
        return Aim(end + CIRCLE.nearest(place - here), self.speed, here, end, CIRCLE)


def swap(seed: int) -> Swarm:
    """Five from a ring to the other side of it."""
    random = np.random.default_rng([seed, 1])
    angle = 0.4 * np.pi * np.arange(5) + random.uniform(-0.3, 0.3, 5)
    places = np.column_stack([6.0 * np.cos(angle), 6.0 * np.sin(angle), np.full(5, 5.0)])
    places += random.uniform(-0.5, 0.5, (5, 3))
    goals = np.roll(places, 2, axis=0) + random.uniform(-0.5, 0.5, (5, 3))
    velocities = random.uniform(-1, 1, (5, 3)) * [1.0, 1.0, 0.3]
    target, ball = np.append(random.uniform(-1, 1, 2), 0.0), np.append(random.uniform(-1, 1, 2), 5.0)
    return Swarm(places, velocities, goals, target, ZERO, ball)


def escort(seed: int) -> Swarm:
    """Five come abreast to a target under way."""
    random = np.random.default_rng([seed, 2])
    places = np.column_stack([np.full(5, -8.0), np.linspace(-3.4, 3.4, 5), np.full(5, 5.0)])
    places += random.uniform(-0.5, 0.5, (5, 3))
    velocities = random.uniform(-1, 1, (5, 3)) * [1.0, 1.0, 0.3]
    target, speed = (np.append(random.uniform(-1, 1, 2), 0.0) for _ in range(2))
    ball = np.array([random.uniform(-4, -3), random.uniform(-1, 1), 5.0])
    return Swarm(places, velocities, None, target, speed, ball)


class Flown(NamedTuple):
    """``places`` (T, K, 3) m and ``gradients`` (T, K): ‖∇J‖ of the plans made there."""

    places: Array
    gradients: Array


def fly(
    config: CompanionConfig,
    swarm: Swarm,
    seconds: float = 4.0,
    epoch: int = START,
    names: Sequence[int] = (1, 2, 3, 4, 5),
) -> Flown:
    count, field = len(swarm.places), config.field
    planners = [Planner(config) for _ in range(count)]
    still = np.zeros((STEPS, 3))
    horizons = [roll_out(epoch, DT, *state, still) for state in zip(*swarm[:2], strict=True)]
    ball = np.tile(swarm.ball, (1, STEPS, 1))
    fixed = Obstacles((1000,), ball, np.array([1.0]), np.array([3.5]), np.array([0.5]))
    places, gradients = [], []
    for now in range(epoch, epoch + round(1e6 * seconds), DT):
        predictions = np.array([horizon.positions(now, STEPS, DT) for horizon in horizons])
        motions, plans = [horizon.at(now) for horizon in horizons], []
        for k, motion in enumerate(motions):
            others = [j for j in range(count) if j != k]
            d_min, d_safe = np.full(count - 1, field.d_min), np.full(count - 1, field.d_safe)
            seen = Obstacles(tuple(names[j] for j in others), predictions[others], d_min, d_safe)
            aim = swarm.aim(k, 1e-6 * (now - epoch), motion.position)
            plans.append(
                planners[k].plan(
                    now, motion.position, motion.velocity, predictions[k], aim, seen.joined(fixed)
                )
            )
        horizons = [plan.horizon for plan in plans]
        places.append([motion.position for motion in motions])
        gradients.append([np.linalg.norm(plan.gradient) for plan in plans])
    return Flown(np.array(places), np.array(gradients))
