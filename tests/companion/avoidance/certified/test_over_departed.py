"""A vehicle below which the companion of another one ended leaves towards its goal, past obstacles."""

from __future__ import annotations

from math import cos, radians, sin
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified.committed import resting
from companion.avoidance.certified.constraint_sources import ConstraintSources
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.peer_plans import stored
from companion.config import CompanionConfig
from companion.values.horizon import Array
from companion.world import View, World
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS, curves, later
from tests.companion.avoidance.certified.rough import FLEET, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

BELOW, GOAL = np.array([0.0, 0.0, 3.0]), np.array([-8.0, 8.0, 4.1])
POSTS = [{"kind": "post", "at": at, "radius": 0.3, "height": 12.0} for at in ([-1.0, 0.0], [0.0, 1.0])]
"""Too near each other for a way between them, on the line to the goal."""


@pytest.mark.parametrize(("angle", "aside"), [(20, 0.14), (135, 0.14), (250, 0.14), (315, 0.45)])
def test_a_vehicle_over_a_departed_one_passes_obstacles_on_any_side(angle: int, aside: float) -> None:
    """Wherever it is over that one by chance. It is just the least distance above, and keeps that."""
    off = aside * np.array([cos(radians(angle)), sin(radians(angle)), 0.0])
    starts = np.array([BELOW, BELOW + off + (0.0, 0.0, 1.1)])
    habits = [Habits(leaves=1_000_000), Habits(steers=3_000_000)]
    swarm = Swarm(starts, Rough(delay=20_000), habits, 1, more={"obstacles": POSTS})

    def of(_since: int, system: int) -> Array:
        return GOAL if system == 2 else starts[0]

    swarm.run(24_000_000, of)
    assert not swarm.faults()
    plans = [swarm.vehicles[1].plan(epoch) for epoch in swarm.epochs()]
    assert np.linalg.norm(plans[-1].position_m - GOAL) <= 0.1
    nearest = min(float(np.linalg.norm(curves(later(plan)) - BELOW, axis=-1).min()) for plan in plans)
    assert swarm.d - 1e-6 <= nearest <= swarm.d + 0.2


def away(height: float, aside: float, *, planar: bool = False, column: bool = False) -> Array:
    """Return the direction (2,) in which a plan leaves the place where one that said farewell rests.

    It rests ``height`` and ``aside`` (least distances) to the south of it, with a goal in the east.
    """
    config = CompanionConfig.model_validate({"avoidance": "certified", "planar": planar})
    sources = ConstraintSources(config, STEPS, FixedSurfaces(config))
    last = resting(EPOCH, DT, STEPS, BELOW, 7, column=column)
    rest = BELOW + sources.between * np.array([0.0, -aside, height])
    own, goal = np.tile(rest, (STEPS, 3, 1)), rest + np.array([20.0, 0.0, 0.0])
    peers = SimpleNamespace(left={9: stored(last)}, members=set(), away=set(), distant={})
    left: Any = SimpleNamespace(peers=peers, agreed=list)
    world = World(config, 1, 190, FLEET)
    others, _ = sources.around(EPOCH, EPOCH, own, goal, left, world, View(None, None, None, None))
    assert len(others.own) == 2
    assert others.controls[0, ..., :2] == pytest.approx(np.zeros((STEPS, 3, 2)), abs=1e-3)
    difference = (others.own[1] - others.controls[1])[-1, 2, :2]
    found: Array = difference / np.linalg.norm(difference)
    return found


def test_only_a_vehicle_over_a_departed_one_leaves_where_it_aims() -> None:
    """Below it, beside it, in a plane, and at a column it leaves away from the place, as from a post."""
    towards, outwards = (1.0, 0.0), (0.0, -1.0)
    assert away(1.2, 0.4) == pytest.approx(towards)
    assert away(-1.2, 0.4) == pytest.approx(outwards)
    assert away(1.2, 0.6) == pytest.approx(outwards)
    assert away(1.2, 0.4, planar=True) == pytest.approx(outwards)
    assert away(1.2, 0.4, column=True) == pytest.approx(outwards)
