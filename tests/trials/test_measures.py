"""The figures of a sortie: each is zero for a flight without its fault, and as large as the fault else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.surfaces import Circle
from trials.measures import (
    HELD,
    NEAR,
    Setpoints,
    converged_after,
    largest_step,
    looks,
    spread,
    surface_errors,
    tracking_errors,
)
from trials.separation import Track

NUMBERS = st.floats(-3.0, 3.0)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
CLOCKS = st.floats(-1e3, 1e3)
RING = Circle(radius=5.0, height=3.0)


def thrown(place, velocity, acceleration, begin=0.0, ahead=0.0):
    """Set-points of one acceleration; the trial's time is ``ahead`` of the own."""
    clock = begin + np.arange(0.0, 2.0, 0.02)
    t = (clock - begin)[:, None]
    places = place + velocity * t + 0.5 * acceleration * t**2
    accelerations = np.tile(acceleration, (len(t), 1))
    return Setpoints(clock + ahead, clock, places, velocity + acceleration * t, accelerations)


@given(VECTORS, VECTORS, VECTORS, CLOCKS, CLOCKS)
def test_what_one_acceleration_leads_to_is_no_step(place, velocity, acceleration, begin, ahead) -> None:
    assert largest_step(thrown(place, velocity, acceleration, begin, ahead)) < 1e-9


@given(VECTORS, VECTORS, VECTORS, st.integers(1, 98), VECTORS)
def test_a_jump_is_a_step_of_its_size_once(place, velocity, acceleration, at, jump) -> None:
    flown = thrown(place, velocity, acceleration)
    flown.places[at:] += jump
    assert largest_step(flown) == pytest.approx(np.linalg.norm(jump), abs=1e-9)


def test_a_pause_is_no_step() -> None:
    flown = thrown(np.zeros(3), np.ones(3), np.zeros(3))
    flown.clock[50:] += 1.0
    assert largest_step(flown) < 1e-9
    assert largest_step(Setpoints(*(column[:1] for column in flown))) == 0.0


@given(VECTORS, VECTORS, VECTORS)
def test_a_vehicle_beside_its_set_points_is_off_by_so_much(place, velocity, beside) -> None:
    flown = thrown(place, velocity, np.zeros(3))
    track = Track(flown.times, flown.places + beside, np.ones(len(flown.times), dtype=bool))
    assert tracking_errors(flown, track) == pytest.approx(np.linalg.norm(beside), abs=1e-9)


def test_only_the_part_that_is_asked_for_counts() -> None:
    flown = thrown(np.zeros(3), np.ones(3), np.zeros(3), ahead=10.0)
    part = flown.between(10.5, 11.0)
    assert (part.times.min(), part.times.max()) == (pytest.approx(10.5), pytest.approx(11.0))
    assert all(len(column) == len(part.times) for column in part)


@given(st.floats(0.1, 6.28), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_the_distance_from_the_ring_is_that_along_and_across(bearing, outward, upward) -> None:
    times = looks(0.0, 1.0)
    centre = np.stack([3.0 * times, -times, 0.5 * times], axis=1)
    radius = 5.0 + outward
    offset = np.array([radius * np.cos(bearing), radius * np.sin(bearing), 3.0 + upward])
    track = Track(times, centre + offset, np.ones(len(times), dtype=bool))
    errors = surface_errors({1: track}, lambda _: centre, RING.nearest, times)
    assert errors == pytest.approx(np.hypot(outward, upward), abs=1e-6)


def test_who_is_not_known_is_beside_nothing() -> None:
    times = looks(0.0, 1.0)
    track = Track(np.array([0.0, 0.5]), np.full((2, 3), 5.0), np.ones(2, dtype=bool))
    errors = surface_errors({1: track}, lambda at: np.zeros((len(at), 3)), RING.nearest, times)
    assert np.isnan(errors[times > 0.51]).all()
    assert not np.isnan(errors[times < 0.49]).any()


@given(st.floats(0.5, 10.0))
def test_all_have_converged_when_the_last_has_for_long_enough(after: float) -> None:
    times = looks(20.0, 40.0)
    errors = np.where((times - 20.0 < after)[:, None], NEAR + 0.1, 0.1) * np.array([1.0, 0.5])
    found = converged_after(errors, times)
    assert found is not None
    assert found == pytest.approx(after, abs=0.03)


def test_who_comes_and_goes_has_not_converged() -> None:
    times = looks(0.0, 20.0)
    coming = (0.1 + NEAR * ((times % HELD) < 0.1))[:, None]
    assert converged_after(coming, times) is None
    assert converged_after(np.full((len(times), 1), np.nan), times) is None


def test_a_spread_is_of_what_is_known() -> None:
    found = spread(np.array([np.nan, *np.arange(101.0)]))
    assert found == (50.0, 95.0, 100.0)
    assert spread(np.full(3, np.nan)) is None
