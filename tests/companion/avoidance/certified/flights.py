"""Flights of a few vehicles at random in which each rule of the agreements matters."""

from __future__ import annotations

from typing import Literal

import numpy as np

from companion.values.horizon import Array
from tests.companion.avoidance.certified.draws import goals, starts
from tests.companion.avoidance.certified.rough import NEVER, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

Kind = Literal["plain", "away", "late", "together", "restart", "quick"]
_FAR = np.array([16.0, 0.0, 5.0])
"""Where nobody flies but the one that restarts there."""


def fly(seed: int, kind: Kind) -> Swarm:
    """Two or three in a room that is too small, on a link that loses and delays.

    "away": two of three leave and return. "late": they do, and all messages arrive again 0.8 s later.
    "together": there are two; both leave and return, in part at the same time, and nothing that they send
    afterwards is received. In some of these flights messages from before arrive again 0.5 s later. "restart":
    a companion stops for longer than a plan and restarts, and nothing of the others is heard for a second
    from 0.5 s before. "quick": a companion restarts at once, while it flies fast outside the room.
    """
    rng = np.random.default_rng(seed)
    longest = 1_000_000 if kind == "away" else 400_000
    rough = Rough(float(rng.choice([0.0, 0.3, 0.6])), int(rng.choice([30_000, 150_000, longest])), 0.2)
    vehicles = 2 if kind == "together" else 3
    places, goal, until = starts(vehicles, seed), goals(seed), 4_000_000
    habits = [Habits()] * vehicles
    if kind == "away":
        habits[1:] = [_leaving(rng) for _ in range(2)]
    elif kind == "late":
        rough = Rough(0.0, 30_000, again=800_000)
        habits[1:] = [_leaving(rng) for _ in range(2)]
    elif kind == "together":
        leaves, returns = int(rng.integers(600_000, 1_500_000)), int(rng.integers(200_000, 500_000))
        leaving = leaves, leaves + int(rng.integers(0, 250_000))
        habits = [Habits(leaves=one, returns=one + returns) for one in leaving]
        mute = tuple((one + returns, NEVER, system) for system, one in enumerate(leaving, 1))
        rough = Rough(0.0, 30_000, mute=mute, again=int(rng.choice([0, 500_000])))
    elif kind == "restart":
        restarts, until = int(rng.integers(4_600_000, 5_200_000)), 8_000_000
        habits[0] = Habits(frozen=((restarts - 4_000_000, restarts),), restarts=restarts)
        rough = rough._replace(mute=tuple((restarts - 500_000, restarts + 500_000, whom) for whom in (2, 3)))
    elif kind == "quick":
        restarts = int(rng.integers(800_000, 2_000_000))
        habits[0] = Habits(frozen=((restarts - int(rng.integers(1, 30_000)), restarts),), restarts=restarts)
        places[0] = _FAR

    def destination(since: int, system: int) -> Array:
        if kind == "quick" and system == 1 and since < habits[0].restarts:
            return np.array([16.0, 6.0 * np.sin(5e-6 * since), 5.0])
        return goal(since, system)

    swarm = Swarm(places, rough, habits, seed)
    swarm.run(until, destination)
    return swarm


def _leaving(rng: np.random.Generator) -> Habits:
    leaves = int(rng.integers(600_000, 2_000_000))
    return Habits(leaves=leaves, returns=leaves + int(rng.choice([40_000, 300_000])))
