"""Vehicles that cannot pass each other give way: no two at one place, and all arrive in a maze of lanes."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config.obstacles import Box
from companion.config.planning import LimitsConfig
from companion.ways.clearance import Clearance
from companion.ways.giving_way import step
from companion.ways.grid import grid
from companion.ways.lanes import Lanes
from companion.ways.lattice import Lattice
from companion.ways.traveller import Traveller
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.swarm import Habits, Rough, Swarm

LIMITS = LimitsConfig(box_min=(-1.0, -1.3, 0.5), box_max=(4.5, 1.3, 2.5))
SIDING = ["########", "        ", "#### ###"]
"""A lane of half a metre from west to east, with one place beside it."""


def walls(rows: list[str], first: float = 0.0) -> list[Box]:
    boxes = [
        Box(kind="box", at=(0.5 * x, first + 0.5 - 0.5 * y, 1.25), size=(0.5, 0.5, 2.5))
        for y, cells in enumerate(rows)
        for x, cell in enumerate(cells)
        if cell == "#"
    ]
    boxes.append(Box(kind="box", at=(2.0, first - 1.25, 1.25), size=(0.5, 0.5, 2.5)))
    boxes += [Box(kind="box", at=(1.75, first + s, 1.25), size=(4.0, 0.1, 2.5)) for s in (-1.2, 1.2)]
    return boxes


def lanes(rows: list[str], first: float = 0.0) -> Clearance:
    return Clearance(walls(rows, first), grid(LIMITS, 0.1, 150_000, 1.0), 0.5)


@pytest.mark.parametrize("first", [0.0, 0.1, -0.2])
def test_a_lattice_lies_in_the_middle_of_lanes_wherever_they_are(first: float) -> None:
    clear = lanes(SIDING, first)
    lattice = Lattice(clear, 0.2, 0.5)
    inside = lattice.places[(np.abs(lattice.places[:, 0] - 1.75) < 1.8)]
    assert len(inside) >= 8
    assert (clear.at(lattice.places) >= 0.2).all()
    in_lane = inside[np.abs(inside[:, 1] - first) < 0.25]
    assert np.allclose(in_lane[:, 1], first)
    for node, beside in enumerate(lattice.beside):
        for other in beside:
            assert node in lattice.beside[other]
            assert clear.free(lattice.places[node], lattice.places[other], 0.2)


@pytest.mark.parametrize("seed", range(20))
def test_no_two_are_at_one_place_and_none_change_places(seed: int) -> None:
    random = np.random.default_rng(seed)
    lattice = Lattice(lanes(SIDING), 0.2, 0.5)
    count = len(lattice.places)
    at = random.permutation(count)[:7].tolist()
    lengths = [lattice.lengths(goal) for goal in random.permutation(count)[:7].tolist()]
    for _ in range(30):
        nexts = step(at, random.permutation(7).tolist(), lengths, lattice.beside)
        assert len(set(nexts)) == 7
        for one, (here, there) in enumerate(zip(at, nexts, strict=True)):
            assert there == here or there in lattice.beside[here]
            for other in range(one):
                assert there == here or (nexts[other], there) != (here, at[other])
        at = nexts


def travellers(lattice: Lattice, at: list[int], goals: list[int]) -> dict[int, Traveller]:
    return {
        11 + k: Traveller(lattice.places[a], lattice.places[g])
        for k, (a, g) in enumerate(zip(at, goals, strict=True))
    }


def test_one_backs_into_the_siding_until_the_other_has_passed() -> None:
    """Each vehicle knows the places and goals only, and goes to what it works out itself."""
    clear = lanes(SIDING)
    lattice, of = Lattice(clear, 0.2, 0.5), Lanes(clear, 0.2, 0.5)
    west, east = (lattice.nearest(np.array([x, 0.0, 1.0])) for x in (-0.5, 4.0))
    at, goals = [west, east], [east, west]
    aside, alone = False, 0
    for _ in range(60):
        known = travellers(lattice, at, goals)
        nexts = []
        for k in range(2):
            subgoal = of.subgoal(11 + k, known)
            lengths = lattice.lengths(goals[k])
            alone += subgoal is None
            if subgoal is None:
                nexts.append(min((at[k], *lattice.beside[at[k]]), key=lambda node: int(lengths[node])))
                continue
            target = lattice.lengths(lattice.nearest(subgoal.place))
            nexts.append(min((at[k], *lattice.beside[at[k]]), key=lambda node: int(target[node])))
        assert nexts[0] != nexts[1]
        assert (nexts[0], nexts[1]) != (at[1], at[0])
        at = nexts
        aside |= bool(lattice.places[at[1]][1] < -0.3)
    assert at == goals
    assert aside
    assert alone > 0


def test_a_sub_goal_is_seen_and_far_ones_are_none() -> None:
    clear = lanes(SIDING)
    of = Lanes(clear, 0.2, 0.5)
    here, there = np.array([0.53, 0.02, 1.0]), np.array([3.5, 0.0, 1.0])
    assert of.subgoal(11, {11: Traveller(here, there)}) is None
    meets = {11: Traveller(here, there), 12: Traveller(np.array([1.0, 0.0, 1.0]), here)}
    ahead = of.subgoal(11, meets)
    assert ahead is not None
    assert clear.sees(here, ahead.place, 0.2)
    # It waits until the other one has left the next place.
    assert np.allclose(ahead.place, [0.5, 0.0, 1.0])
    back = of.subgoal(12, meets)
    assert back is not None
    assert back.place[0] > 1.4


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.5, None])
def test_committed_plans_meet_in_a_lane_and_all_arrive(apart: float | None) -> None:
    """Two vehicles at each side change sides; without ``way.lanes`` they stay where they meet."""
    starts = np.array([[-0.5, 0.0, 1.0], [-0.5, 0.5, 1.0], [4.0, 0.0, 1.0], [4.0, 0.5, 1.0]])
    goals = starts[[3, 2, 1, 0]]
    swarm = Swarm(
        starts,
        Rough(delay=20_000),
        [Habits()] * 4,
        1,
        planar=True,
        settings={"tube": 0.008, "drift": 0.008, "clock_us": 0, "d_min_obstacle": 0.15},
        more={
            "limits": LIMITS.model_copy(update={"v_max": (1.0, 1.0, 1.0)}),
            "field": {"d_min": 0.3, "d_safe": 1.5},
            "way": {"clearance": 0.0, "cell": 0.1, "lanes": apart},
            "obstacles": [one.model_dump() for one in walls(SIDING)],
        },
    )
    swarm.run(25_000_000, lambda _since, system: goals[system - 1])
    ends = np.array([one.plan(EPOCH + 25_000_000).positions_m()[0] for one in swarm.vehicles])
    off = np.linalg.norm(ends - goals, axis=1)
    assert swarm.faults() == []
    assert (off.max() < 0.1) == (apart is not None), off
