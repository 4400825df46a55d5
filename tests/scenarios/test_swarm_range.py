"""Range of the swarm link in flights: the same seed is the same flight, and nobody hears who is beyond."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.header import sending_system
from outrider.errors import InputError
from outrider.realtime.flight import RealTimeFlight
from outrider.scenarios.scenario import Scenario
from outrider.simulation.flight import Flight
from outrider.simulation.preparation import prepared
from outrider.yaml_files.yaml_file import load
from tests.scenarios.lockstep_flights import FIREFLY, Flown, fly, scenario
from tests.scenarios.test_same_seed import facts, logs

RANGE = 5.0
OF = scenario(
    "antipodal-8",
    {
        "vehicles": 2,
        "airborne": True,
        "starts": {"radius": 4.0},
        "cap_s": 2.0,
        "links": {"swarm": {"loss": 0.1, "jitter_ms": 15.0, "range": RANGE}},
    },
)
LATEST = 40_000
"""Largest delay (µs) of a message."""


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return fly(OF, 5, tmp_path_factory.mktemp("first"))


EPOCH = {"dt_us": 200_000, "epoch_us": 200_000}


def heard(flown: Flown, k: int, other: int) -> list[int]:
    """Times (µs) at which vehicle ``k`` received something of vehicle ``other``."""
    system = flown.flight.systems[other]
    return [record.time for record in read_tlog(flown.logs[k]) if sending_system(record.frame) == system]


def test_nobody_hears_who_is_beyond(first: Flown) -> None:
    samples = first.flight.truth.samples()
    times = samples.time
    silent = 0
    for k in range(2):
        for other in {0, 1} - {k}:
            apart = np.linalg.norm(samples.position[:, k] - samples.position[:, other], axis=1)
            arrivals = np.array(heard(first, k, other))
            assert len(arrivals)
            within = np.interp(arrivals, times, apart)
            # Both fly at most 5 m/s per axis while a message is under way.
            assert (within <= RANGE + 2.0 * np.sqrt(3.0) * 5.0 * 1e-6 * LATEST).all()
            silent += int((apart > RANGE + 1.0).sum())
    assert silent


@pytest.mark.parametrize("reverse", [False, True])
def test_the_same_seed_is_the_same_flight(reverse: bool, first: Flown, tmp_path: Path) -> None:
    again = fly(OF, 5, tmp_path / "again", reverse_nodes=reverse)
    assert facts(again) == facts(first)
    assert logs(again) == logs(first)


def test_only_one_process_has_all_places(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"links\.swarm\.range needs the places of all vehicles"):
        Flight(OF, FIREFLY, 5, tmp_path, processes=2)
    with pytest.raises(InputError, match="allowed in real time: null"):
        RealTimeFlight(OF, FIREFLY, 5, tmp_path, tmp_path)


def certified(
    radio: float | None = None, *, planar: bool = False, airborne: bool = True, **settings: object
) -> Scenario:
    limits = {"v_max": [1.5, 1.5, 0.5], "box_min": [-20.0, -20.0, 3.0], "box_max": [20.0, 20.0, 10.0]}
    companion = {"avoidance": "certified", "certified": settings, "limits": limits, "planar": planar}
    links = {"swarm": {"range": radio}}
    return scenario("antipodal-8", {"airborne": airborne, "companion": companion, "links": links})


def test_certified_flights_that_no_range_allows_are_refused() -> None:
    for airborne in (True, False):
        found = prepared(certified(range=15.0, airborne=airborne), "a file").scenario
        assert found.companion.certified.range == 15.0
    with pytest.raises(
        InputError, match=r"a file: companion\.certified\.range = 3 m leaves no room for plans"
    ):
        prepared(certified(range=3.0), "a file")


@pytest.mark.parametrize(
    ("planar", "airborne", "heights"), [(True, True, 0.0), (True, False, 5.0), (False, True, 7.0)]
)
def test_radios_must_reach_so_far_that_who_leaves_is_heard_beyond_the_range(
    planar: bool, airborne: bool, heights: float
) -> None:
    """By two margins and what two vehicles part in an epoch; the error gives a value that is allowed.

    Heights differ by two margins more than those of plans.
    """
    settings = {"range": 15.0, "tube": 0.5, "drift": 0.5, "clock_us": 0, "sigmas": 0.0, **EPOCH}
    leaves = 15.0 + 2.0 * 0.5 + 2.0 * 0.2 * np.sqrt(1.5**2 + 1.5**2 + 0.5**2)
    least = np.hypot(leaves, heights + 2.0 * 0.5)

    def ready(radio: float) -> None:
        prepared(certified(radio, planar=planar, airborne=airborne, **settings), "a file")

    with pytest.raises(InputError, match=r"links\.swarm\.range is 15 m: too little .* more than") as error:
        ready(15.0)
    named = re.search(r"more than ([\d.]+) m", str(error.value))
    assert named is not None
    assert 0.0 <= float(named[1]) - least < 0.001
    ready(float(named[1]) + 0.001)
    with pytest.raises(InputError, match="or that leave it"):
        ready(least - 1e-6)


def test_radios_must_reach_a_vehicle_on_the_ground_within_the_range() -> None:
    """Of those that fly in one plane no plan is above another, but they land."""
    settings = {"range": 15.0, "tube": 0.05, "drift": 0.05, "clock_us": 0, "sigmas": 0.0, **EPOCH}
    high = certified(16.5, planar=True, **settings)
    prepared(high.model_copy(update={"starts": high.starts.model_copy(update={"height": 4.0})}), "a file")
    high = high.model_copy(update={"starts": high.starts.model_copy(update={"height": 9.0})})
    with pytest.raises(InputError, match=r"more than 17\.545 m"):
        prepared(high, "a file")


def test_true_heights_differ_by_two_margins_more_than_those_of_plans() -> None:
    """With `gnss` a margin is 2.062 m, as k · σ counts in each direction."""
    of = certified(45.6, planar=True, range=40.0, **EPOCH).model_copy(update={"sensors": "gnss"})
    with pytest.raises(InputError, match=r"more than 45\.683 m"):
        prepared(of, "a file")


def test_the_radios_of_the_comparison_reach_far_enough() -> None:
    path = Path("config/comparisons/scenarios/range.yaml")
    of = load(path, Scenario)
    assert of.links.swarm.range is not None
    prepared(of, str(path))
