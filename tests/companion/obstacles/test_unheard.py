"""Neighbours that are not heard: what a vehicle may do beside them."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.obstacles.unheard import Heard, Unheard
from companion.values.horizon import Array
from companion.values.speed_bounds import REACTION_S

SECOND = 1_000_000
CONFIG = CompanionConfig.model_validate({"task": "goto", "guard": {"unheard_us": 300_000}})
D_MIN, GROWTH, LOST = CONFIG.field.d_min, CONFIG.guard.unheard_speed, CONFIG.guard.neighbour_lost_us
BRAKING = min(CONFIG.limits.u_max)
ORIGIN = np.zeros(3)
EAST, NORTH = np.array([10.0, 0.0, 0.0]), np.array([0.0, 10.0, 0.0])


def ages(*seconds: float) -> np.ndarray:
    return np.array([round(SECOND * one) for one in seconds], dtype=np.int64)


def heard(*seconds: float, places: Array, planned: bool = False) -> Heard:
    """Hovering neighbours at ``places`` (M, 3) that were heard so many seconds ago."""
    states = np.hstack([places, np.zeros((len(places), 3))])
    return Heard(ages(*seconds), states, np.full(len(places), planned))


def at(*distances: float) -> Array:
    return np.array([[one, 0.0, 0.0] for one in distances])


def pace(rule: Unheard, now: int, what: Heard, towards: Array = EAST) -> float:
    """The speed that is allowed from the origin."""
    bounds = rule.bounds(now, what, ORIGIN)
    return inf if bounds is None else bounds.along(towards)


def test_who_is_heard_holds_up_nobody() -> None:
    rule = Unheard(CONFIG)
    assert rule.radii(ages(0.1, 0.3)).tolist() == [0.0, 0.0]
    assert rule.bounds(0, heard(0.3, places=at(2.0)), ORIGIN) is None


@given(silence=st.floats(0.301, 14.0), distance=st.floats(0.01, 50.0), side=st.floats(-3.0, 3.0))
def test_a_vehicle_stops_before_where_the_other_may_be(silence: float, distance: float, side: float) -> None:
    rule, here = Unheard(CONFIG), np.array([[distance, side, 0.0]])
    bounds = rule.bounds(0, heard(silence, places=here), ORIGIN)
    assert bounds is not None
    closing = bounds.along(EAST) * distance / float(np.linalg.norm(here))
    gap = max(float(np.linalg.norm(here)) - D_MIN, 0.0)
    assert bounds.gaps[0] <= gap
    assert closing**2 / (2.0 * BRAKING) + REACTION_S * closing <= bounds.gaps[0] + 1e-6


@pytest.mark.parametrize("towards", [EAST, -EAST, NORTH])
def test_the_nearer_the_others_may_be_the_slower_a_vehicle_flies_in_every_direction(towards: Array) -> None:
    """The others count on it: they do not know whom it hears."""
    speeds = [pace(Unheard(CONFIG), 0, heard(1.0, places=at(one)), towards) for one in (0.51, 1.0, 3.0, 9.0)]
    assert speeds[0] < 0.02
    assert speeds == sorted(speeds)
    assert speeds[2] <= 3.0 - D_MIN
    slow = [pace(Unheard(CONFIG), 0, heard(one, places=at(3.0)), towards) for one in (0.5, 1.0, 2.0, 9.0)]
    assert slow == sorted(slow, reverse=True)


@pytest.mark.parametrize("planned", [False, True])
def test_a_vehicle_that_is_too_near_leaves_and_comes_no_nearer(planned: bool) -> None:
    what = heard(1.0, places=at(0.4), planned=planned)
    assert pace(Unheard(CONFIG), 0, what) == 0.0
    assert pace(Unheard(CONFIG), 0, what, -EAST) == GROWTH
    # The place that is only possible, and not the last one, is no reason.
    silent = heard(14.0, places=at(0.9))
    assert pace(Unheard(CONFIG), 0, silent, -EAST) < 0.3


def test_the_field_s_distances_stop_growing_when_a_neighbour_is_lost() -> None:
    rule = Unheard(CONFIG)
    most = GROWTH * 1e-6 * (LOST - 300_000)
    assert rule.radii(ages(1.3, 100.0)).tolist() == pytest.approx([GROWTH, most])


def test_who_is_gone_holds_up_nobody_for_ever() -> None:
    rule, wait = Unheard(CONFIG), 1e-6 * CONFIG.guard.unheard_wait_us
    for now in range(0, int(wait) * SECOND, 100_000):
        silent = pace(rule, now, heard(1e-6 * now, places=at(8.0)))
    assert silent < 0.01
    assert pace(rule, int(wait) * SECOND, heard(wait + 0.1, places=at(8.0))) >= GROWTH
    inside = heard(wait + 0.2, places=at(1.0))
    assert pace(rule, int(wait) * SECOND + 100_000, inside, -EAST) == GROWTH


def test_a_silence_is_remembered_and_forgotten() -> None:
    """Heard again, a neighbour is approached as one that may fall silent once more."""
    rule, near = Unheard(CONFIG), at(3.0)
    silent = pace(rule, 0, heard(2.0, places=near))
    again = pace(rule, 100_000, heard(0.0, places=near))
    assert silent < again < 3.0
    assert pace(rule, 30 * SECOND, heard(0.0, places=near)) == inf


@pytest.mark.parametrize("silence", [3.0, 10.0, 60.0])
def test_who_is_heard_again_after_a_long_silence_is_soon_as_any_other(silence: float) -> None:
    rule, near = Unheard(CONFIG), at(2.0)
    assert pace(rule, 0, heard(silence, places=near)) == pytest.approx(0.0)
    assert 0.0 < pace(rule, 50_000, heard(0.0, places=near)) < inf
    assert pace(rule, 12 * SECOND, heard(0.0, places=near)) == inf


def test_a_plan_is_heard_with_the_usual_error_of_vehicles_on_theirs() -> None:
    measured = Unheard(CONFIG).bounds(0, heard(1.0, places=at(6.0)), ORIGIN)
    planned = Unheard(CONFIG).bounds(0, heard(1.0, places=at(6.0), planned=True), ORIGIN)
    assert measured is not None
    assert planned is not None
    assert 0.0 < measured.gaps[0] - planned.gaps[0] < 0.3


def test_at_one_height_places_above_and_below_are_seen_from_the_side() -> None:
    config, here = CONFIG.model_copy(update={"planar": True}), np.array([[3.0, 0.0, 4.0]])
    flat = Unheard(config).bounds(0, heard(1.0, places=here), ORIGIN)
    full = Unheard(CONFIG).bounds(0, heard(1.0, places=here), ORIGIN)
    assert flat is not None
    assert full is not None
    assert flat.gaps == full.gaps
    assert flat.normals.tolist() == [[pytest.approx(0.6), 0.0, 0.0]]


def test_above_and_below_the_downwash_counts() -> None:
    config = CONFIG.model_copy(update={"field": CONFIG.field.model_copy(update={"downwash": 2.0})})
    beside = Unheard(config).bounds(0, heard(1.0, places=at(4.0)), ORIGIN)
    above = Unheard(config).bounds(0, heard(1.0, places=np.array([[0.0, 0.0, 8.0]])), ORIGIN)
    assert beside is not None
    assert above is not None
    assert above.gaps[0] == pytest.approx(beside.gaps[0])
