"""Whom nobody listens to changes no flight: far apart, they fly as if each had heard all."""

from __future__ import annotations

import numpy as np
import pytest
from lockstep_flights import FIREFLY, scenario

from companion.earshot import Earshot
from outrider.flight import Flight
from outrider.resources import config_root

APART = 60.0
"""m between neighbours on the ring: two of four are out of earshot, or only just within it."""
BOX = {"box_min": [-400.0, -400.0, 3.0], "box_max": [400.0, 400.0, 10.0]}
OF = scenario(
    "antipodal",
    {
        "vehicles": 4,
        "airborne": True,
        "cap_s": 3.0,
        "starts": {"apart": APART},
        "companion": {"limits": BOX},
    },
)


def flown() -> Flight:
    flight = Flight(OF, FIREFLY, 1, config_root() / "logs")
    flight.run()
    return flight


def decoded(flight: Flight) -> int:
    return sum(companion.counters["swarm"].good for companion in flight.companions)


def test_who_hears_all_flies_the_same_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    one = flown()
    monkeypatch.setattr(Earshot, "ignores", lambda _self, _sender: False)
    monkeypatch.setattr(
        Earshot, "near", lambda _self, _here, states, _ages: np.ones(len(states), dtype=np.bool_)
    )
    other = flown()
    assert decoded(one) < 0.8 * decoded(other)
    np.testing.assert_array_equal(one.truth.samples().position, other.truth.samples().position)
