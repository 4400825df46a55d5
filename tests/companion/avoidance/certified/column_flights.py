"""Swarms of which some take off and land, in columns of air."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from companion.config import CompanionConfig
from companion.config.certified import CertifiedConfig
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import DT
from tests.companion.avoidance.certified.rough import NEVER, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

CONFIG = CompanionConfig(avoidance="certified", certified=CertifiedConfig(dt_us=DT, epoch_us=DT))
UNTIL = 6_000_000
"""µs of a run."""
ROWS = 2.0
"""m between two places on the ground, which is little more than needed."""


def places(count: int, seed: int) -> Array:
    """A row of places (count, 3), m, at the heights to which they climb."""
    rng = np.random.default_rng(seed)
    row = np.array([[ROWS * k, 0.0, 5.0] for k in range(count)])
    return row + rng.uniform(-0.05, 0.05, (count, 3))


def wandering(count: int, seed: int) -> Callable[[int, int], Array]:
    """Goals above the row of places, now and then a new one: more often above each other than beside."""

    def goal(since: int, system: int) -> Array:
        rng = np.random.default_rng([seed, since // 1_500_000, system])
        place: Array = rng.uniform([-0.5, -0.7, 3.0], [ROWS * count - 1.5, 0.7, 9.0])
        return place

    return goal


def fly(habits: list[Habits], rough: Rough, seed: int, until: int = UNTIL) -> Swarm:
    swarm = Swarm(places(len(habits), seed), rough, habits, seed)
    swarm.run(until, wandering(len(habits), seed))
    return swarm


def lands(rng: np.random.Generator) -> int:
    return int(rng.choice([NEVER, 2_000_000 + int(rng.integers(0, 3_000_000))]))


def at_random(seed: int, rough: Rough) -> Swarm:
    """Some fly from the beginning, some take off, some land, at any time."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 4))
    habits = [Habits(lands=lands(rng), ahead=int(rng.integers(-5_000, 5_001))) for _ in range(count)]
    for k in range(count):
        if rng.random() < 0.6 or k == 0:
            habits[k] = habits[k]._replace(takes_off=int(rng.integers(0, 2_000_000)))
        if rng.random() < 0.2:
            begin = int(rng.integers(0, 5_000_000))
            habits[k] = habits[k]._replace(frozen=((begin, begin + int(rng.integers(20_000, 2_000_000))),))
        if rng.random() < 0.3:
            begins = rng.integers(0, 5_000_000, 4).tolist()
            habits[k] = habits[k]._replace(stalls=tuple((b, b + 700_000) for b in sorted(begins)))
    return fly(habits, rough, seed)


def below(until: int, noise: float = 0.0) -> Swarm:
    """1 is to take off below 2, which hovers; its estimate on the ground has ``noise`` (m)."""
    habits = [Habits(takes_off=0, wanders=noise), Habits()]
    swarm = Swarm(np.array([[0.0, 0.0, 5.0], [0.3, 0.0, 5.0]]), Rough(), habits, 0)
    swarm.run(until, lambda since, system: np.array([0.3, 0.0, 5.0]))
    return swarm
