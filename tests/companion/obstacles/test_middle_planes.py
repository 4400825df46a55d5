"""Planes in the middle between two vehicles that do not hear each other."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.obstacles.middle_planes import MiddlePlanes

BUFFER = 0.5
EVENLY = np.ones(3)
places = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
ONE = np.array([True])


def planes(now: int, age: int, here: np.ndarray, place: np.ndarray) -> MiddlePlanes:
    """Planes of a vehicle at ``place`` that heard the one at ``here`` last."""
    made = MiddlePlanes(BUFFER, EVENLY)
    made.note(now, np.array([age]), here[None], place)
    return made


@given(first=places, second=places, one=places, two=places)
def test_two_that_keep_their_sides_are_two_buffers_apart(
    first: np.ndarray, second: np.ndarray, one: np.ndarray, two: np.ndarray
) -> None:
    """Wherever each of them is, if the gap to the plane that it knows is not used up."""
    assume(np.linalg.norm(second - first) > 0.1)
    along = (second - first) / np.linalg.norm(second - first)
    (mine,), (closing,) = planes(0, 0, second, first).gaps(ONE, one, along)
    (its,), _ = planes(0, 0, first, second).gaps(ONE, two, -along)
    assert closing > 1.0 - 1e-9
    assert np.linalg.norm(two - one) >= 2.0 * BUFFER + min(mine, 0.0) + min(its, 0.0) - 1e-9


@given(direction=places, far=st.floats(0.1, 3.0))
def test_each_metre_uses_up_what_is_said(direction: np.ndarray, far: float) -> None:
    size = np.linalg.norm(direction)
    assume(size > 0.1)
    towards = direction / size
    rule = planes(0, 0, np.array([8.0, 1.0, 0.0]), np.zeros(3))
    (before,), (closing,) = rule.gaps(ONE, np.zeros(3), towards)
    (after,), _ = rule.gaps(ONE, far * towards, towards)
    assert abs(before - after - far * closing) < 1e-9


def test_silence_keeps_the_plane_and_a_message_moves_it() -> None:
    east, rule = np.array([1.0, 0.0, 0.0]), planes(0, 20_000, np.array([8.0, 0.0, 0.0]), np.zeros(3))
    rule.note(500_000, np.array([520_000]), np.array([[6.0, 0.0, 0.0]]), 2.0 * east)
    assert rule.gaps(ONE, 2.0 * east, east)[0].tolist() == [4.0 - BUFFER - 2.0]
    rule.note(600_000, np.array([30_000]), np.array([[7.0, 0.0, 0.0]]), 2.0 * east)
    assert rule.gaps(ONE, 2.0 * east, east)[0].tolist() == [2.5 - BUFFER]


def test_who_is_new_is_heard() -> None:
    rule = planes(0, 0, np.array([8.0, 0.0, 0.0]), np.zeros(3))
    here = np.array([[8.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    rule.note(100_000, np.array([100_000, 5_000]), here, np.zeros(3))
    gaps, _ = rule.gaps(np.array([False, True]), np.zeros(3), np.array([0.0, 1.0, 0.0]))
    assert gaps.tolist() == [2.0 - BUFFER]
