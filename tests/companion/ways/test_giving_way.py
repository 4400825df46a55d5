"""Vehicles that cannot pass each other give way: no two at one place, and all arrive in a maze of lanes."""

from __future__ import annotations

import numpy as np
import pytest

from companion.avoidance.certified.lane_goals import LaneGoals
from companion.avoidance.certified.told_goals import ToldGoals
from companion.config.obstacles import Box
from companion.config.planning import LimitsConfig
from companion.config.way import WayConfig
from companion.ways.clearance import Clearance
from companion.ways.giving_way import step
from companion.ways.grid import grid
from companion.ways.lanes import Lanes
from companion.ways.lattice import Lattice
from companion.ways.traveller import Traveller
from companion.ways.way import Way
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.goal import unpack
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

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


def waiting(at: list[int], nexts: list[int]) -> list[int]:
    """Vehicles that never go if each waits until its next place has been left."""
    left = [one for one in range(len(at)) if nexts[one] != at[one]]
    held = set(at)
    while free := [one for one in left if nexts[one] not in held]:
        left = [one for one in left if one not in free]
        held -= {at[one] for one in free}
    return left


def test_a_full_circle_does_not_turn_while_there_is_a_place_beside_it() -> None:
    """Four on a square, each with the next corner as its goal; beside one corner is a free place."""
    beside = [[1, 3], [0, 2], [1, 3, 4], [0, 2], [2]]
    lengths = [
        np.array(steps) for steps in ([1, 0, 1, 2, 2], [2, 1, 0, 1, 1], [1, 2, 1, 0, 2], [0, 1, 2, 1, 3])
    ]
    nexts = step([0, 1, 2, 3], range(4), lengths, beside)
    assert not waiting([0, 1, 2, 3], nexts)
    assert nexts[0] == 1
    assert 4 in nexts


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
        assert not waiting(at, nexts)
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
    lattice, of = Lattice(clear, 0.2, 0.5), Lanes(clear, 0.2, 0.5, 0.2)
    west, east = (lattice.nearest(np.array([x, 0.0, 1.0])) for x in (-0.5, 4.0))
    at, goals = [west, east], [east, west]
    aside, alone = False, 0
    for _ in range(60):
        known = travellers(lattice, at, goals)
        nexts = []
        for k in range(2):
            subgoal = of.subgoal(11 + k, known, known[11 + k].goal, 0.3)
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
    of = Lanes(clear, 0.2, 0.5, 0.2)
    here, there = np.array([0.53, 0.02, 1.0]), np.array([3.5, 0.0, 1.0])
    assert of.subgoal(11, {11: Traveller(here, there)}, there, 0.3) is None
    meets = {11: Traveller(here, there), 12: Traveller(np.array([1.0, 0.0, 1.0]), here)}
    ahead = of.subgoal(11, meets, there, 0.3)
    assert ahead is not None
    assert clear.sees(here, ahead.place, 0.2)
    # It waits until the other one has left the next place.
    assert np.allclose(ahead.place, [0.5, 0.0, 1.0])
    back = of.subgoal(12, meets, here, 0.3)
    assert back is not None
    assert back.place[0] > 1.4


@pytest.mark.parametrize("aside", [0.0, 0.05, -0.075])
def test_a_vehicle_pushed_aside_as_far_as_plans_go_sees_its_next_place(aside: float) -> None:
    """Lines between places keep 0.22 m in a lane of 0.5 m, plans 0.17 m."""
    clear = lanes(SIDING)
    of = Lanes(clear, 0.22, 0.5, 0.17)
    here, there, west = (np.array([x, y, 1.0]) for x, y in ((0.53, aside), (3.5, 0.0), (-0.5, 0.0)))
    known = {11: Traveller(here, there), 12: Traveller(np.array([2.0, 0.0, 1.0]), west)}
    ahead = of.subgoal(11, known, there, 0.3)
    assert ahead is not None
    assert np.allclose(ahead.place, [1.5, 0.0, 1.0])


def by(x: float, y: float) -> np.ndarray:
    return np.array([x, y, 0.0])


def hall() -> tuple[Lanes, Lattice]:
    """A room without walls, and its lattice of a metre."""
    far = Box(kind="box", at=(9.0, 9.0, 1.25), size=(0.5, 0.5, 2.5))
    clear = Clearance(
        [far], grid(LIMITS.model_copy(update={"box_max": (4.5, 4.5, 2.5)}), 0.1, 150_000, 1.0), 0.5
    )
    return Lanes(clear, 0.2, 1.0, 0.2), Lattice(clear, 0.2, 1.0)


@pytest.mark.parametrize("off", [0.0, 0.1, 0.45])
def test_at_a_goal_beside_its_place_a_vehicle_makes_room_for_those_that_come_past(off: float) -> None:
    """The places of the two are a metre apart, and the goal is nearer to the other place than that."""
    of, lattice = hall()
    place = lattice.places[lattice.nearest(np.array([1.5, 1.5, 1.0]))]
    goal = place + by(0.0, off)
    beside, end = place + by(0.0, 1.0), place + by(2.0, 1.0)
    stands = Traveller(goal, goal, reached=True)
    comes = {11: stands, 12: Traveller(beside - by(2.0, 0.0), end)}
    room = of.subgoal(11, comes, goal, 0.3)
    if off == 0.0:
        assert room is None
        return
    assert room is not None
    assert np.allclose(room.place, place)
    past = {11: Traveller(place, goal, reached=True), 12: Traveller(end, end, reached=True)}
    assert of.subgoal(11, past, goal, 0.3) is None


def test_vehicles_at_goals_a_metre_apart_stay_there_wherever_the_lattice_lies() -> None:
    of, lattice = hall()
    for shift in np.random.default_rng(1).uniform(-0.45, 0.45, (20, 2)):
        first = lattice.places[lattice.nearest(np.array([1.5, 1.5, 1.0]))] + by(*shift)
        goals = [first, first + by(0.0, 1.0), first + by(1.0, 0.0)]
        # At their goals, and at their places.
        for stand in (goals, [lattice.places[lattice.nearest(goal)] for goal in goals]):
            known = {11 + k: Traveller(stand[k], goals[k], reached=True) for k in range(3)}
            for k in range(3):
                assert of.subgoal(11 + k, known, known[11 + k].goal, 0.3) is None


def middle(lattice: Lattice) -> np.ndarray:
    """Place of the ``lattice`` in the middle of the hall."""
    place: np.ndarray = lattice.places[lattice.nearest(np.array([1.0, 0.7, 1.0]))]
    return place


def test_a_vehicle_passes_one_that_stands_beside_its_line_by_its_steps() -> None:
    """By the line it would press against the planes of the other one, which has no reason to make room."""
    of, lattice = hall()
    place = middle(lattice)
    goal, beside, aside = place + by(1.0, 2.0), place + by(1.0, 1.0), place + by(2.0, 1.0)
    stands, comes = Traveller(beside, beside, reached=True), Traveller(place, goal)
    ahead = of.subgoal(11, {11: comes, 12: stands}, goal, 0.7)
    assert ahead is not None
    assert np.allclose(ahead.place, place + by(0.0, 2.0))
    assert of.subgoal(12, {11: comes, 12: stands}, beside, 0.7) is None
    # Not if it keeps clear of the line, without lanes goes another way, or only flies by there.
    assert of.subgoal(11, {11: comes, 12: stands}, goal, 0.4) is None
    assert of.subgoal(11, {11: comes, 12: Traveller(aside, aside, reached=True)}, goal, 0.7) is None
    assert of.subgoal(11, {11: comes, 12: stands}, place + by(0.0, 1.0), 0.7) is None
    assert of.subgoal(11, {11: comes, 12: Traveller(beside, beside + by(3.0, 0.0))}, goal, 0.7) is None


def test_between_two_that_leave_too_little_room_no_step_leads() -> None:
    """They stand at goals beside their places; without lanes the vehicle finds a way around them."""
    of, lattice = hall()
    place = middle(lattice)
    goal = place + by(0.0, 3.0)
    known = {11: Traveller(place, goal)}
    for system, side in ((12, -1.0), (13, 1.0)):
        rest = place + by(0.6 * side, 1.0)
        known[system] = Traveller(rest, rest, reached=True)
    assert of.subgoal(11, known, goal, 0.7) is None
    assert of.subgoal(11, known, goal, 0.5) is None


@pytest.mark.parametrize("seed", range(20))
def test_a_sub_goal_beyond_the_next_place_is_clear_of_those_that_stand_there(seed: int) -> None:
    random = np.random.default_rng(seed)
    of, lattice = hall()
    told = 0
    for _ in range(20):
        at, goal, *stand = random.permutation(len(lattice.places))[:8].tolist()
        known = {11: Traveller(lattice.places[at], lattice.places[goal])}
        for system, node in enumerate(stand, 12):
            rest = lattice.places[node] + by(*random.uniform(-0.45, 0.45, 2))
            known[system] = Traveller(rest, rest, reached=True)
        subgoal = of.subgoal(11, known, lattice.places[goal], 0.6)
        if subgoal is None or lattice.nearest(subgoal.place) in (at, *lattice.beside[at]):
            continue
        told += 1
        line = subgoal.place - lattice.places[at]
        stays = [
            one.rest - lattice.places[at]
            for system, one in known.items()
            if system > 11 and of.subgoal(system, known, one.goal, 0.6) is None
        ]
        off = np.array(stays).reshape(-1, 3)
        share = np.clip(off @ line / (line @ line), 0.0, 1.0)
        assert (np.linalg.norm(off - share[:, None] * line, axis=1) > 0.6 - 1e-6).all()
    assert told > 0


def test_a_vehicle_waits_beside_its_goal_for_one_that_is_to_pass_there() -> None:
    """It would go there and come back at once, and the other one, which sees that, would turn aside."""
    of, lattice = hall()
    goal = middle(lattice) + by(0.0, 1.0)
    waits = Traveller(goal - by(1.0, 0.0), goal, reached=True)

    def place(own: Traveller, *others: Traveller) -> np.ndarray:
        known = {12: own, **dict(enumerate(others, 13))}
        subgoal = of.subgoal(12, known, goal, 0.3)
        return own.goal if subgoal is None else subgoal.place

    comes = Traveller(goal - by(0.0, 2.0), goal + by(0.0, 2.0))
    assert np.allclose(place(waits, comes), waits.rest)
    assert np.allclose(place(waits, comes._replace(rest=goal + by(0.0, 1.0))), goal)
    # Two that make room for nobody else do not wait for each other, whoever else is on its way.
    far = Traveller(goal + by(3.0, 2.0), goal + by(3.0, -2.0))
    assert np.allclose(place(waits, comes._replace(reached=True)), goal)
    assert np.allclose(place(waits, comes._replace(reached=True), far), goal)
    assert np.allclose(place(waits._replace(reached=False), comes), goal)


def test_a_vehicle_makes_room_where_another_one_comes_to_its_place_before_it_is_back() -> None:
    """It stands at its goal in a lane, and leaves it for the siding."""
    clear = lanes(SIDING)
    lattice, of = Lattice(clear, 0.2, 0.5), Lanes(clear, 0.2, 0.5, 0.2)
    here, west, east = (np.array([x, 0.0, 1.0]) for x in (2.0, 1.5, 4.0))
    stands = Traveller(here, here, reached=True)
    room = of.subgoal(12, {12: stands, 13: Traveller(west, east)}, here, 0.3)
    assert room is not None
    assert lattice.nearest(room.place) != lattice.nearest(here)


@pytest.mark.parametrize("off", [0.15, 0.24, 0.26, 0.5])
def test_who_has_been_at_the_place_of_its_goal_has_reached_it(off: float) -> None:
    """Others pass through there: it would come back again and again, and push them out."""
    boxes = walls(SIDING)
    way = Way(WayConfig(clearance=0.0, cell=0.1, lanes=0.5), boxes, LIMITS, 0.2, 10, planar=True)
    way.prepare(1.0)
    lattice = Lattice(lanes(SIDING), 0.2, 0.5)
    place = lattice.places[lattice.nearest(np.array([4.0, 0.0, 1.0]))]
    told = ToldGoals(Source(11, 1), 7)
    goals = LaneGoals(11, told, way, 0.3, in_use=True)
    goal = place + by(0.0, 0.24)
    goals.subgoal(0, place - by(off, 0.0), goal, goal, dict)
    (message,) = told.messages()
    assert isinstance(message, Tunnel)
    assert unpack(message.payload).reached == (off < 0.25)


def distances_from_goals(
    starts: np.ndarray, goals: np.ndarray, seconds: int, delay: int, more: dict[str, object]
) -> np.ndarray:
    """Distances (m) of points from their ``goals`` after these ``seconds``, with settings of LSC's mazes.

    ``delay`` (µs) of messages; ``more``: limits, way and obstacles. The theorem holds in the flight.
    """
    swarm = Swarm(
        starts,
        Rough(delay=delay),
        [Habits()] * len(starts),
        1,
        planar=True,
        settings={"tube": 0.008, "drift": 0.008, "clock_us": 0, "d_min_obstacle": 0.15},
        more={"field": {"d_min": 0.3, "d_safe": 1.5}, **more},
    )
    until = seconds * 1_000_000
    swarm.run(until, lambda _since, system: goals[system - 1])
    ends = np.array([one.plan(EPOCH + until).positions_m()[0] for one in swarm.vehicles])
    assert swarm.faults() == []
    off: np.ndarray = np.linalg.norm(ends - goals, axis=1)
    return off


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.5, None])
def test_committed_plans_meet_in_a_lane_and_all_arrive(apart: float | None) -> None:
    """Two vehicles at each side change sides; without ``way.lanes`` they stay where they meet."""
    starts = np.array([[-0.5, 0.0, 1.0], [-0.5, 0.5, 1.0], [4.0, 0.0, 1.0], [4.0, 0.5, 1.0]])
    lane = {
        "limits": LIMITS.model_copy(update={"v_max": (1.0, 1.0, 1.0)}),
        "way": {"clearance": 0.0, "cell": 0.1, "lanes": apart},
        "obstacles": [one.model_dump() for one in walls(SIDING)],
    }
    off = distances_from_goals(starts, starts[[3, 2, 1, 0]], 25, 20_000, lane)
    assert (off.max() < 0.1) == (apart is not None), off


@pytest.mark.slow
def test_one_arrives_between_vehicles_that_stand_half_a_metre_apart() -> None:
    """Beside a wall it pressed against two of them, and then it and one of these turned back in turn."""
    goals = np.array([[2.0, 0.5 * k + 1.0, 1.0] for k in range(5)])
    starts = goals.copy()
    starts[2] = (1.5, 0.5, 1.0)
    wall = Box(kind="box", at=(1.0, 2.5, 1.25), size=(0.5, 3.5, 2.5))
    limits = {"v_max": (1.0, 1.0, 1.0), "u_max": (2.0, 2.0, 1.0), "box_max": (4.5, 4.5, 2.5)}
    hall = {
        "limits": LIMITS.model_copy(update=limits),
        "field": {"d_min": 0.3, "d_safe": 1.5, "downwash": 2.0},
        "way": {"clearance": 0.2, "cell": 0.1, "lanes": 0.5},
        "obstacles": [wall.model_dump()],
    }
    assert distances_from_goals(starts, goals, 15, 0, hall).max() < 0.1
