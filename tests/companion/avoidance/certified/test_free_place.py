"""Free places by covered goals: laws of the nearest one, and a vehicle that rests there."""

from __future__ import annotations

import numpy as np
import pytest

from companion.avoidance.certified.free_place import covered, free_place
from companion.avoidance.certified.visibility_graph import Discs, Rectangles
from companion.values.horizon import Array
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

LOW, HIGH = np.full(2, -30.0), np.full(2, 30.0)


@pytest.mark.parametrize("seed", range(10))
def test_the_nearest_free_place_is_free_and_no_other_place_is_nearer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    discs = Discs(rng.uniform(-6.0, 6.0, (9, 2)), rng.uniform(1.0, 3.0, 9))
    goal = discs.centres[0] + rng.uniform(-0.5, 0.5, 2)
    assert covered(goal, *discs[:2])
    found = free_place(goal, discs, LOW, HIGH)
    assert found is not None
    assert not covered(found, discs.centres, discs.radii - 1e-5)
    samples = goal + rng.uniform(-1.0, 1.0, (4000, 2)) * (np.linalg.norm(found - goal) / np.sqrt(2.0))
    free = [not covered(place, *discs[:2]) for place in samples]
    off = np.linalg.norm(samples[free] - goal, axis=1)
    assert (off >= np.linalg.norm(found - goal) - 1e-5).all()


def test_a_goal_that_is_free_is_its_own_free_place() -> None:
    discs = Discs(np.array([[3.0, 0.0]]), np.array([1.0]))
    goal = np.array([1.9, 0.0])
    assert not covered(goal, *discs[:2])
    found = free_place(goal, discs, LOW, HIGH)
    assert found is not None
    assert (found == goal).all()


def test_a_free_place_is_within_the_box_and_beside_rectangles() -> None:
    discs = Discs(np.array([[0.0, 0.0]]), np.array([2.0]))
    goal = np.array([0.5, 0.0])
    assert free_place(goal, discs, LOW, np.array([1.0, 30.0])) is None
    wall = Rectangles(np.array([[2.5, 0.0]]), np.array([[0.2, 5.0]]), np.array([[1.0, 0.0]]), np.array([0.5]))
    assert free_place(goal, discs._replace(rectangles=wall), LOW, HIGH) is None
    away = wall._replace(centres=np.array([[5.0, 0.0]]))
    found = free_place(goal, discs._replace(rectangles=away), LOW, HIGH)
    assert found == pytest.approx([2.0, 0.0])


def test_a_vehicle_whose_goal_is_covered_rests_at_the_nearest_free_place() -> None:
    starts = np.array([[0.0, 0.0, 5.0], [-7.0, 0.3, 5.2], [0.0, 6.0, 5.0]])
    goal = np.array([0.5, 0.2, 5.3])
    goals = {1: starts[0], 2: goal, 3: np.array([0.0, -6.0, 5.0])}
    habits = [Habits(leaves=1_000_000), Habits(), Habits()]
    swarm = Swarm(starts, Rough(delay=20_000), habits, 1)

    def of(_since: int, system: int) -> Array:
        return goals[system]

    swarm.run(10_000_000, of)
    ends = [swarm.vehicles[1].plan(epoch).position_m for epoch in swarm.epochs()[-10:]]
    apart = float(np.linalg.norm(goal[:2] - starts[0, :2]))
    for end in ends:
        assert np.linalg.norm(end[:2] - starts[0, :2]) >= swarm.d
        assert np.linalg.norm(end - goal) <= swarm.d - apart + 0.1
    assert np.ptp(ends, axis=0).max() <= 0.1
