"""Turn of the goal for encounters that are predicted."""

from __future__ import annotations

from functools import cache
from math import inf
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.avoidance.certified.anticipation import (
    BEYOND,
    NOBODY,
    Anticipated,
    Anticipation,
    Limits,
    anticipated,
)
from companion.config import CompanionConfig
from companion.config.certified import AnticipationConfig
from companion.values.bearings import turned
from companion.values.horizon import Array
from mavlink_bridge.wire.goal import goal_at, pack
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import FLEET, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

CONFIG = AnticipationConfig()
LEAST, SPEED, ACCELERATION = 1.25, 5.0, 2.0
LIMITS = Limits(LEAST, SPEED, ACCELERATION)
WHOLE_CONFIG = CompanionConfig(
    limits={"v_max": (SPEED,) * 3, "u_max": (ACCELERATION,) * 3},
    certified={"dt_us": 200_000, "epoch_us": 200_000},
)
NEW = 0.0
"""Age of new agreements, s."""
OWN = np.array([[-8.0, 0.0, 5.0], [8.0, 0.0, 5.0]])
places = st.floats(-12.0, 12.0).map(lambda x: round(x, 3))
points = st.tuples(places, places, st.just(5.0))


def found(others: Array, config: AnticipationConfig = CONFIG, sense: float = 1.0) -> Anticipated:
    return anticipated(config, LIMITS, OWN, others, sense=sense)


def straight(place: tuple[float, float], goal: tuple[float, float], height: float = 5.0) -> Array:
    return np.array([[[*place, height], [*goal, height]]])


def ring(count: int, radius: float = 8.0) -> Array:
    """Ways (count, 2, 3) of vehicles that swap places across a circle; the first is ``OWN`` on 8 m."""
    angles = np.pi + 2.0 * np.pi * np.arange(count) / count
    starts = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(count, 5.0)], axis=1)
    return np.stack([starts, starts * (-1.0, -1.0, 1.0)], axis=1)


ONCOMING = straight((6.0, 0.0), (-8.0, 0.0))


def test_two_that_meet_head_on_both_make_room() -> None:
    """Both turn by the same angle, by which together they pass further apart than plans must be."""
    mine = found(ONCOMING)
    theirs = anticipated(CONFIG, LIMITS, ONCOMING[0], OWN[None], sense=1.0)
    assert mine.angle == pytest.approx(theirs.angle)
    assert 2.0 * 7.0 * np.tan(mine.angle) >= LEAST
    assert mine.ahead == CONFIG.reach * SPEED


def test_a_vehicle_that_brakes_slowly_still_reaches_its_largest_speed() -> None:
    slow = anticipated(CONFIG, Limits(LEAST, SPEED, 0.5), OWN, ONCOMING, sense=1.0)
    assert slow.ahead == 0.5 * SPEED**2 / 0.5 > CONFIG.reach * SPEED


@pytest.mark.parametrize("count", [3, 4, 6, 8])
def test_vehicles_that_meet_in_one_place_pass_on_a_circle_with_room_for_all(count: int) -> None:
    """Places that far beside the meeting place, one of each vehicle, are as far apart as plans must be."""
    all_ways = ring(count)
    turns = [
        anticipated(CONFIG, LIMITS, all_ways[k], np.delete(all_ways, k, axis=0), sense=1.0).angle
        for k in range(count)
    ]
    assert turns == pytest.approx([turns[0]] * count)
    radius = 8.0 * np.sin(turns[0])
    assert 2.0 * radius * np.sin(np.pi / count) >= LEAST


@pytest.mark.parametrize(
    "others",
    [
        pytest.param(np.empty((0, 2, 3)), id="nobody"),
        pytest.param(straight((4.0, 0.0), (4.0, 0.0)), id="is at its goal"),
        pytest.param(straight((6.0, 4.0), (-8.0, 4.0)), id="passes on the side away from the turn"),
        pytest.param(straight((6.0, -4.0), (-8.0, -4.0)), id="passes on the side of the turn"),
        pytest.param(straight((-9.0, 0.0), (-18.0, 0.0)), id="flies away"),
        pytest.param(straight((6.0, 0.0), (-8.0, 0.0), 9.0), id="flies above"),
        pytest.param(straight((30.0, 0.0), (-8.0, 0.0)), id="is met beyond the goal"),
        pytest.param(straight((6.0, 0.0), (4.0, 0.0)), id="is at its goal before"),
    ],
)
def test_who_is_not_met_is_not_turned_away_from(others: Array) -> None:
    assert found(others) == NOBODY == Anticipated(0.0, inf)


@settings(max_examples=40)
@given(st.lists(st.tuples(points, points), max_size=5))
def test_the_turn_is_bounded_and_the_same_from_each_side(ends: list[tuple[tuple[float, ...], ...]]) -> None:
    """It does not depend on the order; a mirror changes the sense."""
    others = np.array(ends).reshape(-1, 2, 3)
    one = found(others)
    assert 0.0 <= one.angle <= CONFIG.most
    assert found(others[::-1]).angle == pytest.approx(one.angle)
    assert found(others * (1.0, -1.0, 1.0), sense=-1.0).angle == pytest.approx(one.angle)
    assert found(others, AnticipationConfig(most=0.0)).angle == 0.0


@given(st.floats(-np.pi, np.pi))
def test_directions_of_the_axes_do_not_count(angle: float) -> None:
    def seen(rows: Array) -> Array:
        return np.array([turned(row, angle) for row in rows.reshape(-1, 3)]).reshape(rows.shape)

    here = anticipated(CONFIG, LIMITS, seen(OWN), seen(ONCOMING), sense=1.0)
    assert here.angle == pytest.approx(found(ONCOMING).angle, abs=1e-6)


def test_who_flies_the_same_way_on_the_side_of_the_turn_does_not_count() -> None:
    """To turn with it would be to stay beside it."""
    crosses = straight((-8.0, 2.0), (6.0, -2.0))
    assert 0.0 < found(crosses).angle < found(crosses * (1.0, -1.0, 1.0)).angle


@given(st.integers(2, 20), st.floats(2.0, 20.0), st.floats(0.0, 0.9), st.floats(0.5, 3.0))
def test_a_circle_fits_where_it_does_not_reach_beyond_the_goals(
    count: int, radius: float, flown: float, room: float
) -> None:
    """However near the meeting place the vehicles are already: that does not move their goals."""
    ways = ring(count, radius)
    ways[:, 0] += flown * (ways.mean(axis=1) - ways[:, 0])
    length, small = max((1.0 - flown) * radius, 0.5), 1e-3

    def mine(room: float) -> Anticipated:
        config = CONFIG.model_copy(update={"room": room})
        return anticipated(config, LIMITS, ways[0], ways[1:], sense=1.0)

    wanted = room / small * length * np.tan(mine(small).angle)
    assume(abs(wanted - radius) > 1e-6)
    if wanted > radius:
        assert mine(room) == BEYOND
    else:
        assert mine(room).fits
        assert mine(room).angle == pytest.approx(min(np.arctan(wanted / length), CONFIG.most))


def test_what_does_not_fit_is_left_until_nobody_is_met_or_the_goal_is_another() -> None:
    crowd, few = ring(16), ring(3)
    mine = Anticipation(WHOLE_CONFIG, LEAST, 1.0)
    alone = np.empty((0, 2, 3))
    turned = found(few[1:])
    assert turned.angle > 0.0
    assert mine.met(OWN, few[1:], NEW) == turned
    assert mine.met(OWN, crowd[1:], NEW) == NOBODY
    # The others pass, one after the other, and a smaller circle would fit.
    assert mine.met(OWN, few[1:], NEW) == NOBODY
    assert mine.met(OWN, alone, NEW) == NOBODY
    assert mine.met(OWN, few[1:], NEW) == turned
    assert mine.met(OWN, crowd[1:], NEW) == NOBODY
    elsewhere = OWN + np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert mine.met(elsewhere, few[1:], NEW).angle > 0.0


def test_two_that_meet_fly_straight_until_there_is_a_third() -> None:
    """Once there are several, it anticipates until it meets nobody."""
    mine = Anticipation(WHOLE_CONFIG, LEAST, 1.0)
    one, two = ring(2)[1:], ring(4)[1:3]
    assert found(one).angle > 0.0
    assert mine.met(OWN, one, NEW) == NOBODY
    assert mine.met(OWN, two, NEW) == found(two) != NOBODY
    assert mine.met(OWN, one, NEW) == found(one)
    assert mine.met(OWN, np.empty((0, 2, 3)), NEW) == NOBODY
    assert mine.met(OWN, one, NEW) == NOBODY


def at_age(age: float, others: Array) -> Anticipated:
    """Return what a vehicle does that has agreements on plans of this ``age`` (s)."""
    return Anticipation(WHOLE_CONFIG, LEAST, 1.0).met(OWN, others, age)


@given(st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_the_older_the_agreements_the_larger_the_circle(one: float, two: float) -> None:
    """Not before they are two epochs old, and as for twice this age from then on."""
    others = ring(4)[1:]
    young, old = sorted((one, two))
    assert at_age(young, others).angle <= at_age(old, others).angle
    assert at_age(min(young, 0.4), others) == at_age(0.0, others)
    assert at_age(0.8 + old, others).angle == at_age(0.8, others).angle > at_age(0.4, others).angle
    late = min(max(old - 0.4, 0.0), 0.4)
    apart = 2.0 * 8.0 * np.sin(at_age(old, others).angle) * np.sin(np.pi / 4)
    assert apart >= LEAST * (1.0 + CONFIG.wide_late * late)


def test_the_circle_of_old_agreements_does_not_reach_beyond_the_goals() -> None:
    """It is at most as large as that: here all anticipate, with new agreements and with old ones."""
    crowd = ring(10)[1:]
    new, old = at_age(0.0, crowd), at_age(0.8, crowd)
    assert new != NOBODY != old
    assert np.tan(new.angle) < np.tan(old.angle) == pytest.approx(1.0, abs=0.05)


@cache
def swaps(most: float, *, old: bool = False, planar: bool = True) -> Swarm:
    """Four that swap places, 1 s after they begin, on a ring of 6 m."""
    starts, ends = (ring(4, 6.0)[:, k] for k in (0, 1))
    # Planes that move with the vehicles make room as well, so they do not move here.
    chosen = {"anticipation": {"most": most, "fresh": 0.01 if old else 5.0}, "plane_shift": 0.0}
    swarm = Swarm(starts, Rough(delay=20_000), [Habits()] * 4, 1, planar=planar, settings=chosen)
    swarm.run(4_400_000, lambda since, system: (starts if since < 1_000_000 else ends)[system - 1])
    return swarm


def test_several_that_swap_places_make_room_before_planes_push() -> None:
    """Pushed by planes alone they pass at about the least distance. The turn changes the cost alone."""
    turned_aside, pushed = swaps(1.2), swaps(0.0)
    assert not turned_aside.faults()
    assert turned_aside.least() > 1.3 * turned_aside.d > pushed.least()


class Recorded(NamedTuple):
    """What ``Anticipation.met`` was asked: the own goal (3,), m, and the number of others."""

    goal: Array
    others: int


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Recorded]:
    found: list[Recorded] = []
    met = Anticipation.met

    def recorded(self: Anticipation, own: Array, others: Array, age: float) -> Anticipated:
        found.append(Recorded(own[1], len(others)))
        return met(self, own, others, age)

    monkeypatch.setattr(Anticipation, "met", recorded)
    return found


def test_that_nobody_tells_a_goal_ends_an_encounter(asked: list[Recorded]) -> None:
    """A vehicle that is alone for a time has met nobody then: so each plan says who is met."""
    swarm = Swarm(ring(3)[:1, 0], Rough(), [Habits()], 1, planar=True)
    swarm.run(2_000_000, lambda since, system: OWN[1])
    assert len(asked) == len(swarm.made()) > 3
    assert {one.others for one in asked} == {0}


def test_a_way_round_an_obstacle_is_no_other_goal(asked: list[Recorded]) -> None:
    """What was decided for this goal stays; the sub-goals on the way are not turned aside."""
    post = {"kind": "post", "at": [0.0, 0.0], "radius": 1.0, "height": 10.0}
    limits = {"box_min": (-12.0, -6.0, 3.0), "box_max": (12.0, 6.0, 8.0)}
    more = {"way": {"cell": 1.0}, "obstacles": [post], "limits": limits}
    swarm = Swarm(ring(2)[:1, 0], Rough(), [Habits()], 1, planar=True, more=more)
    swarm.run(3_000_000, lambda since, system: OWN[1])
    ends = [plan.positions_m()[-1] for plan in swarm.vehicles[0].plans.values()]
    assert max(abs(end[1]) for end in ends) > 1.0
    assert len(asked) > 5
    assert all(one.goal.tolist() == OWN[1].tolist() for one in asked)


def test_plans_reach_less_far_while_somebody_is_met_and_agreements_are_fresh() -> None:
    def furthest(swarm: Swarm) -> float:
        ends = [
            plan.positions_m()[-1] - plan.position_m
            for vehicle in swarm.vehicles
            for epoch, plan in vehicle.plans.items()
            if epoch < EPOCH + 2_400_000
        ]
        return float(np.linalg.norm(ends, axis=1).max())

    near, far = (furthest(swaps(1.2, old=old)) for old in (False, True))
    limits = CompanionConfig().limits
    assert near < CONFIG.reach * limits.v_max[0] + 0.05 < far


def test_goals_are_told_only_where_it_is_on_and_there_is_no_room_above() -> None:
    ends = {pack(goal_at(place, FLEET.fingerprint)) for place in ring(4, 6.0)[:, 1]}
    assert not ends & set(swaps(0.0).sent)
    assert not ends & set(swaps(1.2, planar=False).sent)
    assert ends <= set(swaps(1.2).sent)
