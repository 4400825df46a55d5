"""A seed is a flight also where everything goes wrong at once: the same bytes each time and whatever the
order of the nodes, and other bytes for another."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from mavlink_bridge.tlog.log import read_tlog
from outrider.runs.summary import WALL_FIELDS
from tests.scenarios.flight_facts import check_told, clock
from tests.scenarios.lockstep_flights import Flown, fly, scenario

CHANGES: dict[str, Any] = {
    "vehicles": 3,
    "airborne": True,
    "cap_s": 6.0,
    "starts": {"radius": 4.0},
    "sensors": "gnss",
    "weather": {
        "wind": [3.0, 2.0, 0.0],
        "gusts": [{"at_s": 1.0, "length_s": 2.0, "velocity": [0.0, 3.0, 0.0]}],
        "turbulence": "light",
    },
    "links": {
        "autopilot": {"jitter_ms": 5.0, "loss": 0.05},
        "swarm": {
            "loss": 0.1,
            "burst": 3.0,
            "jitter_ms": 15.0,
            "duplication": 0.1,
            "reordering": 0.1,
            "directions": [{"sender": 13, "receiver": 11, "loss": 0.5, "delay_ms": 60.0}],
        },
    },
    "partitions": [{"at_s": 1.0, "for_s": 1.0, "members": [11]}],
    "faults": [
        {"kind": "freeze", "vehicle": 11, "at_s": 0.5, "for_s": 0.7},
        {"kind": "gps_loss", "vehicle": 12, "at_s": 0.5, "for_s": 2.0},
        {"kind": "gps_jump", "vehicle": 13, "at_s": 1.0, "for_s": 2.0, "offset": [1.0, -1.0, 0.5]},
        {"kind": "motor", "vehicle": 13, "at_s": 2.0, "rotor": 3, "left": 0.5},
        {"kind": "clock", "vehicle": 13, "late_ms": 120.0, "drift_ppm": 300.0},
        {"kind": "vanish", "vehicle": 12, "at_s": 4.0},
    ],
    "clocks": {"offset_ms": 50.0, "drift_ppm": 200.0},
}
OF = scenario("antipodal-8", CHANGES)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return fly(OF, 5, tmp_path_factory.mktemp("first"))


def told(flown: Flown) -> str:
    """The summary without what the machine decides, as it is written."""
    return json.dumps({key: value for key, value in flown.summary.items() if key not in WALL_FIELDS})


def logs(flown: Flown) -> list[bytes]:
    return [log.read_bytes() for log in flown.logs]


def test_everything_did_go_wrong(first: Flown) -> None:
    check_told(first)
    samples, _ = clock(first)
    assert (np.linalg.norm(samples.estimate_error, axis=-1).max(axis=0) > 0.1).all()
    assert np.linalg.norm(first.flight.autopilots[0].wind) > 1.0
    assert first.flight.network.counters.dropped > 100
    ends = [max(record.time for record in read_tlog(log)) for log in first.logs]
    assert ends[0] - ends[1] > 1_500_000


@pytest.mark.parametrize("reverse", [False, True])
def test_the_same_seed_is_the_same_flight(
    reverse: bool, first: Flown, tmp_path_factory: pytest.TempPathFactory
) -> None:
    again = fly(OF, 5, tmp_path_factory.mktemp("again"), reverse_nodes=reverse)
    assert told(again) == told(first)
    assert logs(again) == logs(first)
    for mine, theirs in zip(clock(again)[0], clock(first)[0], strict=True):
        assert mine.tobytes() == theirs.tobytes()


def test_another_seed_is_another_flight(first: Flown, tmp_path_factory: pytest.TempPathFactory) -> None:
    other = fly(OF, 6, tmp_path_factory.mktemp("other"))
    check_told(other)
    assert other.summary["min_separation_m"] != first.summary["min_separation_m"]
    assert other.summary["estimate_error_m"] != first.summary["estimate_error_m"]
    assert not set(logs(other)) & set(logs(first))
