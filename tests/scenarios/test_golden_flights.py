"""Short flights whose set-points were looked at and found good: what changes them by mistake is noticed.

``pytest --update-golden`` makes the files anew. Differences between machines grow with every encounter: these
are few vehicles, and few seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from outrider.testing.flown import Flown, Replayed

LOGS = Path(__file__).resolve().parents[1] / "data" / "logs"
SHORT: dict[str, Any] = {"airborne": True, "cap_s": 3.0}
FLIGHTS: dict[str, tuple[str, dict[str, Any]]] = {
    "swap-tangential": ("antipodal-8", {"vehicles": 3}),
    "swap-certified": (
        "antipodal-8",
        {"vehicles": 3, "companion": {"avoidance": "certified", "turning_sense": "right"}},
    ),
    "swap-px4": ("antipodal-8", {"vehicles": 2, "flavour": "px4", "sensors": "rtk"}),
    "jump": ("scenario-1", {}),
    "walk": ("walk", {}),
    "posts": ("obstacles", {}),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_is_as_it_was(name: str, fly: Callable[..., Flown]) -> None:
    scenario, changes = FLIGHTS[name]
    flown = fly(scenario, **{**SHORT, **changes})
    flown.assert_separation(at_least=1.0)
    told = flown.setpoints()
    told.assert_continuous(step=0.15, acceleration=7.0)
    told.assert_rate(at_least=45, gap=0.1)
    told.assert_golden(name, within=0.01)


def test_what_is_made_of_a_recorded_flight_is_as_it_was(replay: Callable[..., Replayed]) -> None:
    would = replay(LOGS / "copter-whole.tlog", own=9)
    would.assert_continuous(step=0.3)
    would.assert_golden("copter-whole", within=0.01)
