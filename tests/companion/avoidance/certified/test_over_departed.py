"""A vehicle below which the companion of another one ended leaves towards its goal, past obstacles."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest

from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import curves, later
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

BELOW, RISE, GOAL = np.array([0.0, 0.0, 3.0]), np.array([0.0, 0.0, 3.0]), np.array([-8.0, 8.0, 6.0])
POSTS = [{"kind": "post", "at": at, "radius": 0.3, "height": 12.0} for at in ([-1.0, 0.0], [0.0, 1.0])]
"""Too near each other for a way between them, on the line to the goal."""


@pytest.mark.parametrize("angle", [20, 135, 250])
def test_a_vehicle_over_a_departed_one_passes_obstacles_on_any_side(angle: int) -> None:
    """Wherever it is over that one by chance, and it keeps its distance from that one's last plan."""
    aside = 0.14 * np.array([cos(radians(angle)), sin(radians(angle)), 0.0])
    starts = np.array([BELOW, BELOW + RISE + aside])
    habits = [Habits(leaves=1_000_000), Habits(steers=3_000_000)]
    swarm = Swarm(starts, Rough(delay=20_000), habits, 1, more={"obstacles": POSTS})

    def of(_since: int, system: int) -> Array:
        return GOAL if system == 2 else starts[0]

    swarm.run(24_000_000, of)
    plans = [swarm.vehicles[1].plan(epoch) for epoch in swarm.epochs()]
    assert np.linalg.norm(plans[-1].position_m - GOAL) <= 0.1
    nearest = min(float(np.linalg.norm(curves(later(plan)) - BELOW, axis=-1).min()) for plan in plans)
    assert nearest >= swarm.d
