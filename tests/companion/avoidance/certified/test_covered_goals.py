"""A vehicle whose goal is covered leaves the goal of another one that asks for room."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified.committed import resting as at_rest
from companion.avoidance.certified.deadlock import DeadlockTurn, Pushes
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.peer_plans import stored
from companion.avoidance.certified.places import Places
from companion.avoidance.certified.plan_goals import PlanGoals
from companion.avoidance.certified.room import Room
from companion.avoidance.certified.told_goals import ToldGoals
from companion.avoidance.certified.way_obstacles import WayObstacles
from companion.avoidance.field.planner import standing
from companion.config import CompanionConfig
from companion.config.certified import DeadlockConfig
from companion.values.horizon import Array
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.goal import WireRoom, goal_at, pack, room_to, unpack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS

ORIGIN, EAST, UP = np.array([0.0, 0.0, 5.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
SECOND = 1_000_000


class Beside:
    """A vehicle whose goal is 0.5 m east of the origin, where one that said farewell rests."""

    def __init__(self, *, planar: bool) -> None:
        config = CompanionConfig.model_validate({"avoidance": "certified", "planar": planar})
        self.told = ToldGoals(Source(1, 1), 7)
        obstacles = WayObstacles(config, FixedSurfaces(config))
        self.d = obstacles.between
        self._places = Places(config, 1, self.told, obstacles)
        landed = {9: stored(at_rest(EPOCH, DT, STEPS, ORIGIN, 7))}
        self._peers: Any = SimpleNamespace(left=landed, columns=(), resting=lambda *_: {})

    def place(self, now: int) -> Array:
        """Where it goes at ``now`` µs, (3,), m."""
        aim = standing(ORIGIN + 0.5 * EAST)
        return self._places.destination(now, EPOCH, ORIGIN + 2.0 * EAST, aim, self._peers)


@pytest.mark.parametrize("planar", [True, False])
@pytest.mark.parametrize("rank", [0, 1])
def test_the_place_beside_a_covered_goal_is_not_on_the_goal_of_one_that_asks_for_room(
    planar: bool, rank: int
) -> None:
    vehicle = Beside(planar=planar)
    nearest = vehicle.place(0)
    goal = nearest + 0.7 * vehicle.d * EAST
    vehicle.told.receive(0, 2, pack(goal_at(goal, 7)))
    assert (vehicle.place(0) == nearest).all()
    vehicle.told.receive(0, 2, pack(goal_at(goal, 7, room=room_to(goal, rank))))
    place = vehicle.place(0)
    assert np.linalg.norm(place - goal) >= vehicle.d
    assert np.linalg.norm(place - ORIGIN) >= vehicle.d
    # What is not told any more is no obstacle.
    assert (vehicle.place(3 * SECOND) == nearest).all()


@pytest.mark.parametrize("planar", [True, False])
def test_in_space_a_goal_high_above_the_place_leaves_it_free(planar: bool) -> None:
    vehicle = Beside(planar=planar)
    nearest = vehicle.place(0)
    goal = nearest + 2.5 * vehicle.d * UP
    vehicle.told.receive(0, 2, pack(goal_at(goal, 7, room=room_to(goal, 0))))
    assert bool((vehicle.place(0) == nearest).all()) is not planar


def told(
    others: dict[int, Array], landed: Array, *, planar: bool, stalled: bool = True, **limits: Any
) -> WireRoom | None:
    """The room that a vehicle asks for whose goal is the origin; None: none.

    Others rest at ``others`` (3,), m, by system id, and one has ``landed`` (3,). ``stalled``: the vehicle
    makes no progress.
    """
    document = {"avoidance": "certified", "planar": planar, "limits": limits}
    config = CompanionConfig.model_validate(document)
    obstacles, goals_told = WayObstacles(config, FixedSurfaces(config)), ToldGoals(Source(1, 1), 7)
    rest = ORIGIN - 0.6 * obstacles.between * EAST
    peers = SimpleNamespace(
        left={9: stored(at_rest(EPOCH, DT, STEPS, landed, 7))},
        columns=(),
        resting=lambda *_: others | {9: landed},
        ends=lambda: others,
        newest=dict,
    )
    agreements: Any = SimpleNamespace(peers=peers, age=lambda *_: 0.0)
    turn = DeadlockTurn(DeadlockConfig(), 1.0)
    goals = PlanGoals(config, Source(1, 1), agreements, obstacles, goals_told, turn, 1.0)
    goals.prepare(5.0)
    own, start = np.tile(rest, (STEPS, 3, 1)), at_rest(EPOCH, DT, STEPS, rest, 7)
    against = Pushes(np.array([[-50.0, 0.0, 0.0]]), np.zeros((1, 3)))
    while stalled and not turn.stalled:
        turn.learn(rest, ORIGIN, against, 1.0, 0.2)
    goals.chosen(EPOCH, EPOCH, start, own, ORIGIN, given=True, moving=False)
    messages = [one for one in goals_told.messages() if isinstance(one, Tunnel)]
    return unpack(messages[0].payload).room if messages else None


BESIDE, LANDED = ORIGIN + 0.8 * EAST, ORIGIN + 2.0 * EAST


@pytest.mark.parametrize("planar", [True, False])
def test_a_vehicle_asks_for_room_while_another_one_rests_on_its_goal_beside_a_landed_one(
    planar: bool,
) -> None:
    room = told({2: BESIDE}, LANDED, planar=planar)
    assert room is not None
    # Nobody leaves a goal for that.
    assert room.rank == 7
    assert told({2: BESIDE}, LANDED, planar=planar, stalled=False) is None
    assert told({2: ORIGIN + 30.0 * EAST}, LANDED, planar=planar) is None


@pytest.mark.parametrize("planar", [True, False])
def test_a_vehicle_that_rests_on_a_goal_far_from_landed_ones_is_not_asked_to_leave(planar: bool) -> None:
    assert told({2: BESIDE}, ORIGIN + 30.0 * EAST, planar=planar) is None


@pytest.mark.parametrize("planar", [True, False])
def test_in_space_a_vehicle_that_rests_high_above_a_goal_is_not_on_it(planar: bool) -> None:
    above = BESIDE + 2.5 * UP
    assert (told({2: above}, LANDED, planar=planar) is None) is not planar


def test_a_landed_vehicle_on_the_goal_is_not_asked_to_leave() -> None:
    """There is no free place beside it in the box, so the goal stays the destination."""
    box = {"box_min": (-4.0, -1.0, 0.5), "box_max": (1.0, 1.0, 9.0)}
    assert told({}, BESIDE, planar=True, **box) is None


class Asking:
    """A vehicle on the way to its goal, which is the origin."""

    def __init__(self) -> None:
        config = CompanionConfig.model_validate({"avoidance": "certified", "planar": True})
        obstacles = WayObstacles(config, FixedSurfaces(config))
        self.d = obstacles.between
        self._room = Room(config, 1, ToldGoals(Source(1, 1), 7), obstacles)

    def rank(self, before: float, *, closed: bool = False) -> int | None:
        """The rank with which it asks, ``before`` (m) its goal, on which one rests; None: none."""
        peers: Any = SimpleNamespace(left={}, columns=(), resting=lambda *_: {}, ends=dict)
        rest = ORIGIN - before * EAST
        self._room.destination(0, 0, rest, ORIGIN, peers)
        asked = self._room.asked(rest, ORIGIN, closed=closed, occupied=True)
        return None if asked is None else asked.rank


def test_while_a_closed_way_is_the_cause_the_rank_is_that_of_a_closed_way() -> None:
    vehicle = Asking()
    assert [vehicle.rank(8.0 * vehicle.d, closed=closed) for closed in (False, True, False)] == [7, 0, 0]


def test_once_it_has_gone_on_from_a_closed_way_only_the_occupied_goal_is_the_cause() -> None:
    vehicle = Asking()
    ranks = [vehicle.rank(before * vehicle.d, closed=before == 8.0) for before in (8.0, 7.0, 5.5, 5.0)]
    assert ranks == [0, 0, None, 7]
