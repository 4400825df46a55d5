"""Symmetry of the whole swarm: mirrored, turned, elsewhere, later, with vehicles exchanged it flies alike.

Rounding, 1e-15 at first, grows in every encounter, so flights are short: within 5 s the worst of some hundred
were 7e-7 m apart. A sense that is not mirrored throws them apart by decimetres at least.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from companion.values.horizon import Array
from tests.companion.swarm import OTHER, START, WAYS, configured, escort, fly, swap

CLOSE = 1e-4
"""m."""
MIRROR = np.diag([1.0, -1.0, 1.0])
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SWARMS = {"swap": swap(3), "escort": escort(3)}
flights = pytest.mark.parametrize(
    ("name", "sense", "which"), [(*way, which) for which in SWARMS for way in WAYS]
)


@cache
def flown(name: str, sense: str, which: str) -> Array:
    return fly(configured(name, sense), SWARMS[which]).places


@flights
def test_in_these_flights_vehicles_meet_and_every_method_acts(name, sense, which):
    places = flown(name, sense, which)
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=3)
    assert apart[:, ~np.eye(5, dtype=bool)].min() < 2.0
    if name != "baseline":
        assert np.abs(places - flown("baseline", "own", which)).max() > 0.5
        # A common sense is another flight, or its mirror image would say nothing about senses.
        assert np.abs(flown(name, "right", which) - flown(name, "own", which)).max() > 0.5


@flights
def test_a_mirrored_swarm_flies_in_the_mirror(name, sense, which):
    """To the other side, where the sense is common to all."""
    mirrored = fly(configured(name, OTHER[sense]), SWARMS[which].seen(MIRROR)).places
    np.testing.assert_allclose(mirrored, flown(name, sense, which) @ MIRROR.T, atol=CLOSE)


@flights
def test_a_swarm_flies_alike_wherever_it_is_and_whichever_way_it_faces(name, sense, which):
    """A quarter turned, because bounds are per axis, and on its level, because the box has a floor near
    by."""
    shift = np.array([2.3, -1.7, 0.0])
    elsewhere = fly(configured(name, sense), SWARMS[which].seen(QUARTER, shift)).places
    np.testing.assert_allclose(elsewhere, flown(name, sense, which) @ QUARTER.T + shift, atol=CLOSE)


@flights
def test_exchanged_vehicles_exchange_their_flights(name, sense, which):
    """Not bit for bit: forces are then summed in another order."""
    order = (3, 0, 4, 2, 1)
    names = [1 + k for k in order]
    exchanged = fly(configured(name, sense), SWARMS[which].ordered(order), names=names).places
    np.testing.assert_allclose(exchanged, flown(name, sense, which)[:, list(order)], atol=CLOSE)


@flights
def test_neither_names_nor_the_time_of_day_matter(name, sense, which):
    """Bit for bit."""
    again = fly(configured(name, sense), SWARMS[which], epoch=START - 987_654_321, names=(9, 3, 200, 11, 5))
    np.testing.assert_array_equal(again.places, flown(name, sense, which))
