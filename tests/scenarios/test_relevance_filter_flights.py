"""Whom nobody listens to changes no flight: they come from far apart, meet, and fly as if each had heard
all."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from companion.obstacles.neighbours import Neighbours
from companion.obstacles.relevance_filter import RelevanceFilter
from outrider.resources import config_root
from outrider.simulation.flight import Flight
from tests.scenarios.lockstep_flights import FIREFLY, scenario

APART = 90.0
"""m between neighbours on the ring of four: at first all are out of earshot."""
BOX = {"box_min": [-400.0, -400.0, 3.0], "box_max": [400.0, 400.0, 10.0]}
OF = scenario(
    "antipodal",
    {
        "vehicles": 4,
        "airborne": True,
        "cap_s": 32.0,
        "starts": {"apart": APART},
        "companion": {"limits": BOX, "rates": {"replan_us": 50_000}},
    },
)


def flown() -> Flight:
    flight = Flight(OF, FIREFLY, 1, config_root() / "logs")
    flight.run()
    return flight


def decoded(flight: Flight) -> int:
    return sum(companion.counters["swarm"].good for companion in flight.companions)


def all_are(near: bool) -> Callable[..., np.ndarray]:
    return lambda _self, _places, states, _ages: np.full(len(states), near)


@pytest.mark.slow
def test_who_hears_all_flies_the_same_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    one = flown()
    monkeypatch.setattr(Neighbours, "ignores", lambda *_: False)
    monkeypatch.setattr(RelevanceFilter, "near", all_are(True))
    other = flown()
    assert decoded(one) < 0.9 * decoded(other)
    np.testing.assert_array_equal(one.truth.samples().position, other.truth.samples().position)
    # They do meet: who saw nobody would fly elsewhere.
    monkeypatch.setattr(RelevanceFilter, "near", all_are(False))
    blind = flown().truth.samples().position
    assert len(blind) != len(one.truth.samples().position) or (
        np.abs(blind - one.truth.samples().position).max() > 0.5
    )
