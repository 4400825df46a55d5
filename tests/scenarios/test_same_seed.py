"""A seed is a flight: the same bytes each time and whatever the order of the nodes, and other bytes for
another."""

from __future__ import annotations

import pytest

from outrider.runs.summary import WALL_FIELDS, Value
from tests.scenarios.lockstep_flights import Flown, check, fly, scenario

OF = scenario(
    "antipodal-8",
    {
        "vehicles": 3,
        "starts": {"radius": 3.0},
        "links": {"swarm": {"loss": 0.1, "jitter_ms": 15.0, "duplication": 0.1, "reordering": 0.1}},
    },
)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return fly(OF, 5, tmp_path_factory.mktemp("first"))


def facts(flown: Flown) -> dict[str, Value]:
    """The summary without what the machine decides."""
    return {key: value for key, value in flown.summary.items() if key not in WALL_FIELDS}


def logs(flown: Flown) -> list[bytes]:
    return [log.read_bytes() for log in flown.logs]


def test_the_first_one_is_a_flight(first: Flown) -> None:
    check(first)
    dropped = first.summary["messages"]
    assert isinstance(dropped, dict)
    assert (dropped["dropped"] or 0) > 0


def test_the_same_seed_is_the_same_flight(first: Flown, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Also with the nodes in the reverse order."""
    again = fly(OF, 5, tmp_path_factory.mktemp("again"), reverse_nodes=True)
    assert facts(again) == facts(first)
    assert logs(again) == logs(first)


@pytest.mark.slow
def test_another_seed_is_another_flight(first: Flown, tmp_path_factory: pytest.TempPathFactory) -> None:
    other = fly(OF, 6, tmp_path_factory.mktemp("other"))
    check(other)
    assert facts(other)["min_separation_m"] != facts(first)["min_separation_m"]
    assert not set(logs(other)) & set(logs(first))
