"""Ways past others that rest where the shortest one leads."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config.obstacles import Box
from companion.config.planning import LimitsConfig
from companion.config.way import WayConfig
from companion.values.horizon import Array
from companion.ways.balls import Balls
from companion.ways.clearance import Clearance
from companion.ways.grid import grid
from companion.ways.way import Way
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

LIMITS = LimitsConfig(box_min=(-5.0, -6.0, 0.5), box_max=(5.0, 6.0, 2.5), v_max=(1.0, 1.0, 1.0))
START, GOAL = np.array([-3.0, -1.0, 1.0]), np.array([3.0, -1.0, 1.0])


def wall(*gaps: float) -> list[Box]:
    """A wall from side to side with gaps of 1.2 m about these places."""
    edges = [-6.0, *(edge for gap in sorted(gaps) for edge in (gap - 0.6, gap + 0.6)), 6.0]
    return [
        Box(kind="box", at=(0.0, 0.5 * (low + high), 1.25), size=(0.5, high - low, 2.5))
        for low, high in zip(edges[::2], edges[1::2], strict=True)
    ]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("high", [1.0, 2.0])
def test_clearances_among_balls_are_the_least_of_both(seed: int, high: float) -> None:
    """Of fixed obstacles, and of balls that are lower by the measure of distances; the old ones stay."""
    random = np.random.default_rng(seed)
    alone = Clearance(wall(0.0), grid(LIMITS, 0.25, 150_000, 1.0), 0.8)
    before = alone.cells.copy()
    centres, radii = random.uniform(-4.0, 4.0, (4, 3)), random.uniform(0.1, 1.0, 4)
    among = alone.among(Balls(centres, radii, np.full(4, 1.0 / high)))
    points = random.uniform(-5.0, 5.0, (200, 3))
    off = (points[:, None] - centres) / [1.0, 1.0, high]
    wanted = np.minimum(alone.at(points), (np.linalg.norm(off, axis=2) - radii).min(axis=1))
    assert np.allclose(among.at(points), wanted, atol=1e-12)
    assert np.allclose(among.cells, among.at(among.grid.places(np.arange(len(among.grid)))), atol=1e-12)
    assert (alone.cells == before).all()
    assert np.isinf(Balls(np.zeros((0, 3)), np.zeros(0), np.zeros(0)).distance(points)).all()


def follow(way: Way) -> Array:
    for _ in range(200):
        way.towards(START, GOAL)
        if way._followed is not None and way._search is None:
            return way._followed.corners
    raise AssertionError("no way")


def crosses(corners: Array) -> float:
    """Where the way passes the wall."""
    return float(np.interp(0.0, corners[:, 0], corners[:, 1]))


def test_a_way_goes_round_those_that_rest_and_comes_back_where_they_leave_none() -> None:
    way = Way(WayConfig(clearance=0.0, cell=0.1), wall(0.0, 4.0), LIMITS, 0.35, 10, planar=True)
    assert abs(crosses(follow(way))) < 0.6
    first = Balls(np.array([[0.0, 0.0, 1.0]]), np.array([0.3]), np.zeros(1))
    way.go_round(0, lambda: first)
    assert abs(crosses(follow(way)) - 4.0) < 0.6
    assert way.goes_round
    both = Balls(np.array([[0.0, 0.0, 1.0], [0.0, 4.0, 1.0]]), np.array([0.3, 0.3]), np.zeros(2))
    # Too early.
    way.go_round(4_999_999, lambda: both)
    assert abs(crosses(follow(way)) - 4.0) < 0.6
    way.go_round(5_000_000, lambda: both)
    assert abs(crosses(follow(way))) < 0.6
    assert not way.goes_round
    assert not way.enclosed


@pytest.mark.parametrize("rests", [0.0, 0.9])
def test_a_vehicle_passes_the_further_gap_where_another_one_rests_in_the_nearer_one(rests: float) -> None:
    """Or behind it, so that the straight way is free of walls and blocked by that one alone."""
    stays = np.array([rests, 0.0, 1.0])
    swarm = Swarm(
        np.stack([stays, START]),
        Rough(delay=20_000),
        [Habits()] * 2,
        1,
        planar=True,
        settings={"tube": 0.008, "drift": 0.008, "clock_us": 0, "d_min_obstacle": 0.3},
        more={
            "limits": LIMITS,
            "field": {"d_min": 0.6, "d_safe": 1.5},
            "way": {"clearance": 0.1, "cell": 0.1},
            "obstacles": [one.model_dump() for one in wall(0.0, 4.0)],
        },
    )
    until = 30_000_000
    swarm.run(until, lambda _since, system: stays if system == 1 else GOAL)
    ends = np.array([one.plan(EPOCH + until).positions_m()[0] for one in swarm.vehicles])
    assert np.abs(ends - [stays, GOAL]).max() < 0.1
    assert swarm.faults() == []
