"""Neighbours that are not heard: what a vehicle may do beside them."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.obstacles.unheard import Unheard

SECOND = 1_000_000
CONFIG = CompanionConfig.model_validate({"task": "goto", "guard": {"unheard_us": 300_000}})
D_MIN, GROWTH, LOST = CONFIG.field.d_min, CONFIG.guard.unheard_speed, CONFIG.guard.neighbour_lost_us
ORIGIN = np.zeros(3)
EAST = np.array([10.0, 0.0, 0.0])


def ages(*seconds: float) -> np.ndarray:
    return np.array([round(SECOND * one) for one in seconds], dtype=np.int64)


def at(*distances: float) -> np.ndarray:
    return np.array([[one, 0.0, 0.0] for one in distances])


def test_who_is_heard_holds_up_nobody() -> None:
    rule = Unheard(CONFIG)
    assert rule.radii(ages(0.1, 0.3)).tolist() == [0.0, 0.0]
    assert rule.pace(0, ages(0.3), at(2.0), ORIGIN, EAST) == inf
    assert not rule.confined(0, ages(0.3), at(1.0), ORIGIN, 5.0)


@given(silence=st.floats(0.301, 60.0), distance=st.floats(0.01, 50.0), side=st.floats(-3.0, 3.0))
def test_a_vehicle_stops_before_where_the_other_may_be(silence: float, distance: float, side: float) -> None:
    rule, age = Unheard(CONFIG), ages(silence)
    here = np.array([[distance, side, 0.0]])
    speed = rule.pace(0, age, here, ORIGIN, EAST)
    off = float(np.linalg.norm(here))
    closing = speed * distance / off
    gap = max(off - D_MIN - float(rule.radii(age)[0]), 0.0)
    braking = min(CONFIG.limits.u_max)
    assert closing**2 / (2.0 * braking) + 0.2 * closing <= gap + 1e-6


def test_away_from_it_a_vehicle_may_fly_and_inside_the_ball_not_towards_it() -> None:
    rule = Unheard(CONFIG)
    assert rule.pace(0, ages(2.0), at(-2.0), ORIGIN, EAST) == inf
    assert rule.pace(0, ages(2.0), at(1.0), ORIGIN, EAST) == pytest.approx(0.0)


def test_the_field_s_distances_stop_growing_when_a_neighbour_is_lost() -> None:
    rule = Unheard(CONFIG)
    most = GROWTH * 1e-6 * (LOST - 300_000)
    assert rule.radii(ages(1.3, 100.0)).tolist() == pytest.approx([GROWTH, most])


@given(distance=st.floats(9.0, 20.0), start=st.floats(0.0, 2.0), silence=st.floats(1.0, 15.0))
def test_two_that_do_not_hear_each_other_do_not_meet(distance: float, start: float, silence: float) -> None:
    """Head on, as fast as the rule allows each of them, for as long as one waits for the other."""
    rules, braking, step = (Unheard(CONFIG), Unheard(CONFIG)), min(CONFIG.limits.u_max), 0.05
    places, speed = np.array([0.0, distance]), np.array([start, start])
    ahead = np.array([1.0, -1.0])
    last = places.copy()
    for n in range(int(silence / step)):
        age = n * step
        for own, rule in enumerate(rules):
            # The course of the other one, extrapolated for a second.
            there = last[1 - own] + ahead[1 - own] * start * min(age, 1.0)
            here, place = np.array([[there, 0.0, 0.0]]), np.array([places[own], 0.0, 0.0])
            allowed = min(rule.pace(round(SECOND * age), ages(age), here, place, ahead[own] * EAST), 5.0)
            speed[own] += np.clip(allowed - speed[own], -braking * step, braking * step)
        places += ahead * speed * step
        assert places[1] - places[0] > D_MIN


def test_who_is_gone_holds_up_nobody_for_ever() -> None:
    rule, wait = Unheard(CONFIG), 1e-6 * CONFIG.guard.unheard_wait_us
    assert rule.pace(0, ages(wait), at(8.0), ORIGIN, EAST) == pytest.approx(0.0)
    assert rule.pace(100_000, ages(wait + 0.1), at(8.0), ORIGIN, EAST) >= GROWTH


def test_a_silence_is_remembered_and_forgotten() -> None:
    """Heard again, a neighbour is approached as one that may fall silent once more."""
    rule, near = Unheard(CONFIG), at(3.0)
    silent = rule.pace(0, ages(2.0), near, ORIGIN, EAST)
    again = rule.pace(100_000, ages(0.0), near, ORIGIN, EAST)
    assert silent < again + 1e-9 < 3.0
    assert rule.pace(30 * SECOND, ages(0.0), near, ORIGIN, EAST) == inf


@pytest.mark.parametrize("silence", [3.0, 10.0, 60.0])
def test_who_is_heard_again_after_a_long_silence_is_soon_as_any_other(silence: float) -> None:
    rule, near = Unheard(CONFIG), at(2.0)
    assert rule.pace(0, ages(silence), near, ORIGIN, EAST) == pytest.approx(0.0)
    assert 0.0 < rule.pace(50_000, ages(0.0), near, ORIGIN, EAST) < inf
    assert rule.pace(12 * SECOND, ages(0.0), near, ORIGIN, EAST) == inf


def test_near_it_a_vehicle_is_slow_and_far_from_it_not() -> None:
    rule = Unheard(CONFIG)
    assert rule.confined(0, ages(1.0), at(3.0), ORIGIN, 1.0)
    assert not rule.confined(0, ages(1.0), at(30.0), ORIGIN, 5.0)
