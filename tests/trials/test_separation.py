"""The measure of a trial: how near two came is found between their messages, and only where they flew."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trials.separation import GAP, Track, blind, longest_gap, nearest

NUMBERS = st.floats(-5.0, 5.0)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
END = 4.0


def straight(place, velocity, phase, armed=True):
    times = np.concatenate([[0.0], np.arange(phase, END, 0.05), [END]])
    return Track(times, place + times[:, None] * velocity, np.full(len(times), armed))


def far(times):
    return np.full((len(times), 3), 1e3)


@given(VECTORS, VECTORS, VECTORS, VECTORS, st.floats(0.001, 0.04))
def test_two_straight_ways_are_nearest_where_geometry_says(x, v, y, w, phase):
    off, speed = x - y, v - w
    at = 0.0 if speed @ speed == 0.0 else float(np.clip(-(off @ speed) / (speed @ speed), 0.0, END))
    found = nearest({1: straight(x, v, 0.02), 2: straight(y, w, phase)}, (100, far))
    (pair,) = [one for one in found if one.pair == (1, 2)]
    # Half a step of the grid beside it, at the ways' speed.
    assert pair.distance == pytest.approx(np.linalg.norm(off + at * speed), abs=0.0026 * 18.0)


def test_who_stands_with_motors_off_is_near_to_nobody():
    here = straight(np.zeros(3), np.zeros(3), 0.02)
    off = straight(np.zeros(3), np.zeros(3), 0.02, armed=False)
    assert {one.pair for one in nearest({1: here, 2: off}, (100, far))} == {(1, 100)}


def test_a_silence_is_no_straight_way():
    times = np.array([0.0, 0.1, 3.0, 3.1])
    way = Track(times, np.outer(times, [1.0, 0.0, 0.0]), np.ones(4, dtype=bool))
    crossing = straight(np.array([1.5, 0.0, 0.0]), np.zeros(3), 0.02)
    (pair,) = [one for one in nearest({1: way, 2: crossing}, (100, far)) if one.pair == (1, 2)]
    assert pair.distance > 1.3
    assert longest_gap(way) == pytest.approx(2.9)


def test_a_flight_of_which_too_little_is_known_is_not_passed():
    assert blind(0.9 * GAP) == []
    (fault,) = blind(2.9)
    assert "for 2.9 s" in fault


@given(VECTORS, VECTORS, st.floats(0.1, 3.0))
def test_the_way_from_a_time_on_is_the_farthest_place_from_then_on(x, v, since):
    track = straight(x, v, 0.02)
    begin = track.times[track.times >= since][0]
    assert track.moved(since) == pytest.approx(float(np.linalg.norm(v)) * (END - begin), abs=1e-9)
    assert track.moved(END + 1.0) == 0.0


def test_without_a_target_there_are_only_pairs_of_vehicles():
    here, there = straight(np.zeros(3), np.zeros(3), 0.02), straight(np.ones(3), np.zeros(3), 0.01)
    (pair,) = nearest({1: here, 2: there})
    assert (pair.pair, pair.distance) == ((1, 2), pytest.approx(3.0**0.5))
