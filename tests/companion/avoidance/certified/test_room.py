"""Vehicles at their goals make room for one that cannot get on, and return: laws of points on a channel."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.room import Room
from companion.avoidance.certified.told_goals import ToldGoals
from companion.avoidance.certified.way_obstacles import WayObstacles
from companion.config import CompanionConfig
from companion.values.horizon import Array
from mavlink_bridge.messages import Source
from mavlink_bridge.wire.goal import WireRoom, goal_at, pack, room_to
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

GOAL = np.array([9.0, 0.0, 5.0])
ROUGH = Rough(delay=20_000)


def ring(count: int, radius: float, height: float = 5.0) -> Array:
    """Places (count, 3) on a circle around the origin, m."""
    angles = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(count, height)], axis=1)


def flown(around: Array, *, rough: Rough = ROUGH, until: int = 30_000_000, planar: bool = True) -> Swarm:
    """A vehicle at the origin, in the midst of vehicles ``around`` it (k, 3) that are at their goals."""
    starts = np.vstack([[0.0, 0.0, 5.0], around])
    goals = starts.copy()
    goals[0] = GOAL
    swarm = Swarm(starts, rough, [Habits()] * len(starts), 1, planar=planar)
    swarm.run(until, lambda since, system: goals[system - 1])
    return swarm


def off(swarm: Swarm, goals: Array, at: int) -> Array:
    """Distances (k,) of the vehicles from ``goals`` (k, 3) at ``at`` µs, m."""
    places = [vehicle.plan(EPOCH + at).positions_m()[0] for vehicle in swarm.vehicles]
    result: Array = np.linalg.norm(np.array(places) - goals, axis=1)
    return result


def closed(swarm: Swarm, around: Array) -> bool:
    """Whether the gaps between neighbours in a ring ``around`` (k, 3) are too narrow for a vehicle."""
    gaps = np.linalg.norm(around - np.roll(around, 1, axis=0), axis=1)
    return bool(swarm.d < gaps.min() and gaps.max() < 2.0 * swarm.d)


@pytest.mark.parametrize("rough", [ROUGH, Rough(0.3, 100_000)], ids=["prompt", "lossy"])
def test_a_vehicle_leaves_a_ring_of_vehicles_at_their_goals_and_all_are_at_their_goals_afterwards(
    rough: Rough,
) -> None:
    around = ring(8, 2.0)
    swarm = flown(around, rough=rough)
    assert closed(swarm, around)
    assert swarm.faults() == []
    assert off(swarm, np.vstack([GOAL, around]), 30_000_000).max() < 0.3


def test_without_room_it_stays_in_the_ring(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Room, "destination", lambda _self, _now, _epoch, _rest, goal, _peers: goal)
    around = ring(8, 2.0)
    assert off(flown(around), np.vstack([GOAL, around]), 30_000_000)[0] > 3.0


@pytest.mark.slow
def test_those_behind_make_room_for_those_who_make_room() -> None:
    """Two rings: who stands in the inner one has no free place beside the corridor."""
    around = np.vstack([ring(8, 2.0), ring(14, 3.4)])
    swarm = flown(around, until=20_000_000)
    assert closed(swarm, around[:8])
    assert closed(swarm, around[8:])
    assert swarm.faults() == []
    assert off(swarm, np.vstack([GOAL, around]), 20_000_000).max() < 0.3


class Standing:
    """A vehicle ``own`` at its goal ``here`` (3,), m, others that rest at ``others`` (k, 3), and who asks."""

    def __init__(self, here: Array, others: Array | None = None, *, own: int = 20, **settings: Any) -> None:
        document = {"avoidance": "certified", "planar": True, **settings}
        self.config = CompanionConfig.model_validate(document)
        self.here = here
        self.told = ToldGoals(Source(own, 1), 7)
        self.obstacles = WayObstacles(self.config, FixedSurfaces(self.config))
        self.room = Room(self.config, own, self.told, self.obstacles)
        self.d = self.obstacles.between
        self._others = {100 + k: place for k, place in enumerate([] if others is None else others)}
        self._ends: dict[int, Array] = {}

    def ask(self, now: int, system: int, end: Array, onwards: Array, goal: Array, rank: int = 0) -> None:
        """Let ``system``, whose plan ends at ``end``, ask for room ``onwards`` (3,), m, at ``now`` µs."""
        self._ends[system] = end
        told = goal_at(goal, 7, room=room_to(onwards, rank))
        self.told.receive(now, system, pack(told))

    def place(self, now: int, rest: Array | None = None) -> Array:
        """Where it goes at ``now`` µs, (3,), m."""
        peers: Any = SimpleNamespace(
            left={}, columns=(), resting=lambda *_: self._others, ends=lambda: self._ends | self._others
        )
        rest = self.here if rest is None else rest
        return self.room.destination(now, 0, rest, self.here, peers)

    def asks(self, rest: Array, onwards: Array, *, closed: bool = False) -> WireRoom | None:
        """What it asks for on its way ``onwards`` (3,), m, from the end of its plan ``rest`` (3,), m."""
        return self.room.asked(rest, onwards, closed=closed, occupied=False)


ORIGIN, EAST = np.array([0.0, 0.0, 5.0]), np.array([1.0, 0.0, 0.0])
FAR = np.array([50.0, 0.0, 5.0])


def across(standing: Standing, now: int = 0, system: int = 11, *, side: float = 0.0, rank: int = 0) -> None:
    """Ask for room for a vehicle that goes east through the origin, ``side`` m beside it."""
    beside = np.array([0.0, side, 0.0])
    standing.ask(
        now, system, ORIGIN + beside - standing.d * EAST, ORIGIN + beside + standing.d * EAST, FAR, rank
    )


def beside(place: Array) -> float:
    """Distance (m) of ``place`` (3,) from the line east through the origin."""
    return float(np.hypot(*(place - ORIGIN)[1:]))


def test_who_is_not_asked_stays_and_who_is_stands_beside_the_corridor_and_returns() -> None:
    standing = Standing(ORIGIN)
    assert standing.place(0) is ORIGIN
    across(standing, 1_000_000)
    place = standing.place(1_000_000)
    assert standing.room.moved
    assert beside(place) > standing.d
    # It does not ask: it has room.
    assert standing.asks(ORIGIN, place) is None
    assert standing.place(1_200_000, place) is place
    assert not standing.room.moved
    # What was told counts for two seconds.
    assert standing.place(4_000_000, place) is ORIGIN
    assert standing.room.moved


def test_it_keeps_its_place_while_the_corridor_moves_a_little() -> None:
    standing = Standing(ORIGIN)
    standing.place(0)
    across(standing)
    place = standing.place(0)
    side = np.sign(place[1]) * 0.05 * standing.d
    across(standing, side=side)
    assert standing.place(0, place) is place
    across(standing, side=3.0 * side)
    assert standing.place(0, place) is not place


def test_one_that_was_not_at_its_goal_flies_on() -> None:
    standing = Standing(ORIGIN)
    across(standing)
    assert standing.place(0, ORIGIN + EAST) is ORIGIN


def test_two_goals_of_which_only_one_can_be_reached_are_not_given_up() -> None:
    standing = Standing(ORIGIN)
    standing.place(0)
    standing.ask(0, 11, ORIGIN - standing.d * EAST, ORIGIN, ORIGIN + 0.9 * standing.d * EAST)
    assert standing.place(0) is ORIGIN
    standing.ask(0, 11, ORIGIN - standing.d * EAST, ORIGIN, ORIGIN + 1.05 * standing.d * EAST)
    assert standing.place(0) is not ORIGIN


def test_the_place_is_free_of_those_that_rest_and_of_posts_and_inside_the_box() -> None:
    rng, free = np.random.default_rng(3), 0
    for _ in range(20):
        others = ORIGIN + np.column_stack([rng.uniform(-4.0, 4.0, (5, 2)), np.zeros(5)])
        posts = [{"kind": "post", "at": tuple(at), "radius": 0.3} for at in rng.uniform(-4.0, 4.0, (2, 2))]
        limits = {"box_min": (-5.0, -5.0, 0.5), "box_max": (5.0, 5.0, 10.0)}
        standing = Standing(ORIGIN, others, obstacles=posts, limits=limits)
        standing.place(0)
        across(standing)
        place = standing.place(0)
        assert beside(place) > standing.d
        assert np.abs(place[:2]).max() <= 5.0
        for post in posts:
            assert np.linalg.norm(place[:2] - np.array(post["at"])) > 0.3 + standing.config.field.d_min
        if standing.asks(place, place) is None:
            free += 1
            assert np.linalg.norm(others - place, axis=1).min() > standing.d
    assert free > 3


def test_without_a_free_place_it_asks_for_room_with_a_rank_one_higher() -> None:
    d = Standing(ORIGIN).d
    standing = Standing(ORIGIN, ring(12, 1.4 * d))
    standing.place(0)
    across(standing, rank=2)
    place = standing.place(0)
    assert beside(place) > d
    asked = standing.asks(ORIGIN, place)
    assert asked is not None
    assert asked.rank == 3
    assert asked.next_place_m == pytest.approx(place, abs=1e-3)


@pytest.mark.parametrize("ranks", [(0, 1), (1, 1), (2, 1)])
@pytest.mark.parametrize("own", [5, 20])
def test_of_two_that_ask_for_room_one_stands_aside(ranks: tuple[int, int], own: int) -> None:
    """``ranks``: that of the other one, 11, and of the vehicle ``own`` once it asks."""
    d = Standing(ORIGIN).d
    other, mine = ranks
    standing = Standing(ORIGIN, ring(12, 1.4 * d), own=own)
    standing.place(0)
    across(standing, rank=mine - 1, system=1)
    standing.place(0)
    # It goes on asking for the first one, 1; the other one asks for room across its goal, to north.
    north = np.array([0.0, d, 0.0])
    standing.ask(0, 11, ORIGIN - north, ORIGIN + north, FAR, other)
    place = standing.place(0)
    before = (other, 11) < (mine, own)
    assert (abs(place[0]) > d) == before


@pytest.mark.parametrize("planar", [True, False])
def test_in_space_a_corridor_far_above_concerns_nobody(planar: bool) -> None:
    standing = Standing(ORIGIN, planar=planar)
    standing.place(0)
    above = np.array([0.0, 0.0, 1.2 * standing.d])
    standing.ask(0, 11, ORIGIN + above - EAST, ORIGIN + above + EAST, FAR)
    assert (standing.place(0) is ORIGIN) == (not planar)


def test_a_vehicle_asks_once_it_is_closed_in_until_it_has_gone_on_or_is_at_its_goal() -> None:
    standing = Standing(ORIGIN)
    rest = ORIGIN - 5.0 * EAST
    standing.place(0, rest)
    assert standing.asks(rest, ORIGIN) is None
    asked = standing.asks(rest, ORIGIN, closed=True)
    assert asked is not None
    assert asked.rank == 0
    # The corridor is two least distances long.
    assert asked.next_place_m == pytest.approx(rest + 2.0 * standing.d * EAST, abs=1e-3)
    standing.place(1, rest + EAST)
    assert standing.asks(rest + EAST, ORIGIN) is not None
    standing.place(2, ORIGIN)
    assert standing.asks(ORIGIN, ORIGIN) is None


def test_a_rank_ends_with_the_goal_for_which_room_was_made() -> None:
    d = Standing(ORIGIN).d
    standing = Standing(ORIGIN, ring(12, 1.4 * d))
    standing.place(0)
    across(standing, rank=2)
    standing.place(0)
    standing.here = ORIGIN + 20.0 * EAST
    assert standing.place(0, ORIGIN) is standing.here
    asked = standing.asks(ORIGIN, standing.here, closed=True)
    assert asked is not None
    assert asked.rank == 0


@pytest.mark.parametrize("ids", [(11, 12), (12, 11)])
def test_of_two_that_return_to_their_goals_head_on_one_stands_aside_and_neither_changes_its_mind(
    ids: tuple[int, int],
) -> None:
    """Both have been at their goals, were pushed off, and ask for room on the way back."""
    d = Standing(ORIGIN).d
    homes = ORIGIN, ORIGIN + 1.05 * d * EAST
    two = [Standing(home, own=own) for home, own in zip(homes, ids, strict=True)]
    rests = ORIGIN + 1.4 * d * EAST, ORIGIN - 0.4 * d * EAST
    for one in two:
        one.place(0)
    moved = [0, 0]
    for now in range(0, 4_000_000, 200_000):
        places = [one.place(now, rest) for one, rest in zip(two, rests, strict=True)]
        for k, (one, other) in enumerate(zip(two, two[::-1], strict=True)):
            moved[k] += one.room.moved
            asked = one.asks(rests[k], places[k], closed=now == 0)
            if asked is not None:
                other.ask(now, ids[k], rests[k], asked.next_place_m, one.here, asked.rank)
    assert sum(place is not one.here for place, one in zip(places, two, strict=True)) == 1
    assert max(moved) <= 1


def test_a_place_for_the_first_of_several_is_kept() -> None:
    """Corridors from all sides leave no place for all: there is one for the lowest rank."""
    d = Standing(ORIGIN).d
    limits = {"box_min": (-1.2 * d, -1.2 * d, 0.5), "box_max": (1.2 * d, 1.2 * d, 10.0)}
    standing = Standing(ORIGIN, limits=limits)
    standing.place(0)
    across(standing, rank=0)
    for system, angle in enumerate(np.linspace(0.3, 2.8, 5), 12):
        way = d * np.array([np.cos(angle), np.sin(angle), 0.0])
        standing.ask(0, system, ORIGIN - way, ORIGIN + way, FAR, 1)
    place = standing.place(0)
    assert beside(place) > d
    for _ in range(5):
        assert standing.place(0, place) is place
        assert not standing.room.moved


@pytest.mark.parametrize("rank", [7, 8, 255])
def test_for_ranks_of_seven_and_more_nobody_stands_aside(rank: int) -> None:
    standing = Standing(ORIGIN)
    standing.place(0)
    across(standing, rank=rank)
    assert standing.place(0) is ORIGIN


def test_a_next_place_far_away_counts_up_to_the_length_of_a_corridor() -> None:
    """What others tell is not bounded: up to 2147 km on the wire."""
    standing = Standing(ORIGIN)
    standing.place(0)
    standing.ask(0, 11, ORIGIN - 2.5 * standing.d * EAST, ORIGIN + 2e6 * EAST, FAR)
    assert standing.place(0) is not ORIGIN
    standing.ask(0, 11, ORIGIN - 3.5 * standing.d * EAST, ORIGIN + 2e6 * EAST, FAR)
    assert standing.place(0) is ORIGIN


def test_it_does_not_ask_at_its_goal() -> None:
    standing = Standing(ORIGIN)
    near = ORIGIN + 0.15 * EAST
    standing.place(0, near)
    assert standing.asks(near, ORIGIN, closed=True) is None


def test_one_that_stands_aside_and_makes_no_progress_does_not_return_for_that() -> None:
    """Its id is the lower one, so that it would not stand aside if it asked for room itself."""
    standing = Standing(ORIGIN, own=5)
    standing.place(0)
    across(standing)
    place = standing.place(0)
    assert standing.asks(ORIGIN + 0.3 * (place - ORIGIN), place, closed=True) is None
    assert standing.place(0, ORIGIN + 0.3 * (place - ORIGIN)) is place


def test_it_asks_no_more_once_it_has_gone_on_by_the_length_of_a_corridor() -> None:
    standing = Standing(ORIGIN)
    rest = ORIGIN - 9.0 * standing.d * EAST
    standing.place(0, rest)
    assert standing.asks(rest, ORIGIN, closed=True) is not None
    for gone, asks in ((1.9, True), (2.1, False), (1.9, False)):
        there = rest + gone * standing.d * EAST
        standing.place(0, there)
        assert (standing.asks(there, ORIGIN) is not None) == asks
