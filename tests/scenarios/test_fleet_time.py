"""Certified flights in measured fleet time: whatever their clocks show, vehicles keep apart and arrive, or
hold and say why."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from companion.avoidance.certified.commitment import HoldReason
from companion.avoidance.certified.fleet_clock import FleetClock
from companion.planning.certified import CertifiedAvoidance
from mavlink_bridge.messages import StatusText
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.certify.reading import read
from outrider.certify.verdict import judge
from outrider.replay.run_replay import again
from outrider.resources import config_root
from outrider.runs.summary import Cost, summarise
from outrider.simulation.flight import EPOCH, Flight
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from tests.scenarios.lockstep_flights import FIREFLY, Flown, Watch, scenario

BOUND = 50_000
SWAP: dict[str, Any] = {
    "vehicles": 3,
    "airborne": True,
    "sensors": "rtk",
    "cap_s": 15.0,
    "flavour": ["ardupilot", "px4"],
    "companion": {
        "avoidance": "certified",
        "turning_sense": "right",
        "ground_messages": {"texts": True},
        "certified": {
            "fleet_time": "measured",
            "clock_us": BOUND,
            "time_sources": {"autopilot_us": 3_000},
        },
    },
}
MINUTES = [
    {"kind": "clock", "vehicle": 11, "late_ms": 180_000.0, "drift_ppm": 50.0},
    {"kind": "clock", "vehicle": 12, "late_ms": -240_000.0, "drift_ppm": -50.0},
]
DRIFT = [
    {"kind": "autopilot_clock", "vehicle": 11, "utc_error_ms": 3.0, "drift_ppm": -50.0},
    {"kind": "autopilot_clock", "vehicle": 12, "utc_error_ms": -3.0, "drift_ppm": 50.0},
]
BLIND = {"kind": "autopilot_clock", "vehicle": 12, "utc": False}
DISCIPLINED = {"clocks": {"system_us": 2_000}}
NO_AUTOPILOT: dict[str, Any] = {"companion": {"certified": {"time_sources": {"autopilot_us": None}}}}
UTC_STEP = {"kind": "utc_step", "vehicle": 12, "at_s": 1.5, "step_ms": 5_000.0}
CLOCK_STEP = {"kind": "clock_step", "vehicle": 12, "at_s": 1.5, "step_ms": -5_000.0}


def clock_of(flight: Flight, k: int) -> FleetClock:
    clock = flight.companions[k]._fleet_clock
    assert clock is not None
    return clock


def held(flight: Flight, k: int, reason: HoldReason) -> int:
    avoidance = flight.companions[k].avoidance
    assert isinstance(avoidance, CertifiedAvoidance)
    return avoidance._flight.commitment.held[reason]


def texts(flown: Flown, system: int) -> set[str]:
    """The texts for the ground in the log of a vehicle."""
    codec = Codec(lambda identifier, _system, _component: identifier == 253)
    records = read_tlog(flown.directory / f"vehicle-{system}.tlog")
    messages = [message for record in records for message in codec.feed(record.frame)]
    return {m.text for m in messages if isinstance(m, StatusText) and m.source.component != 1}


def fly(directory: Path, *changes: dict[str, Any], reference: int | None = None) -> Flown:
    """Fly the swap; at every sample each companion's fleet time must be within its bound of the true one.

    That is UTC, or the clock of the companion ``reference``.
    """
    of = scenario("antipodal-8", SWAP, *changes)

    def look(flight: Flight, now: int) -> None:
        truth = now if reference is None else flight.fleet.clock(reference, EPOCH).local(now)
        for k in range(of.vehicles):
            clock = clock_of(flight, k)
            if clock.trouble is None and clock.ahead is not None:
                shown = flight.fleet.clock(k, EPOCH).local(now) + clock.ahead
                # It is brought up to date at the companion's next step.
                assert abs(shown - truth) <= clock.error + 100 <= BOUND + 100

    watch, logs = Watch(), config_root() / "logs"
    flight = Flight(of, FIREFLY, 1, logs, progress=watch, run_directory=directory, onlooker=look)
    flight.run()
    flown = Flown(flight, summarise(flight.outcome, Cost(1.0, 1.0), directory), watch, directory)
    assert flown.summary["d_min_violations"] == 0
    assert flown.summary["anchored_anew"] == 0
    separation = flown.summary["min_separation_m"]
    assert isinstance(separation, float)
    assert separation > 1.2
    return flown


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"faults": [*MINUTES, *DRIFT]},
        {"faults": [BLIND]},
        {"faults": [*MINUTES, BLIND, {**BLIND, "vehicle": 13}]},
        {"faults": [UTC_STEP]},
        {"faults": [*MINUTES, CLOCK_STEP], **DISCIPLINED, **NO_AUTOPILOT},
    ],
    ids=[
        "sound clocks",
        "clocks off by minutes that drift",
        "one without UTC",
        "two without UTC",
        "one autopilot's UTC steps",
        "one system clock steps",
    ],
)
def test_they_keep_apart_and_arrive(changes: dict[str, Any], tmp_path: Path) -> None:
    flown = fly(tmp_path, changes)
    assert flown.summary["converged"] is True
    assert [backup.carried for backup in flown.flight.backup_nodes] == [0, 0, 0]


def test_the_clock_of_one_vehicle_is_fleet_time_without_any_other_source(tmp_path: Path) -> None:
    """Whatever that clock shows."""
    reference = {"companion": {"certified": {"time_sources": {"reference": 12}}}}
    flown = fly(tmp_path, NO_AUTOPILOT, reference, {"faults": MINUTES}, reference=1)
    assert flown.summary["converged"] is True
    assert clock_of(flown.flight, 1).ahead == 0


def test_two_that_cannot_tell_who_is_wrong_hold_and_say_so(tmp_path: Path) -> None:
    flown = fly(tmp_path, {"vehicles": 2, "faults": [UTC_STEP]})
    assert flown.summary["converged"] is False
    for k, system in enumerate((11, 12)):
        assert held(flown.flight, k, HoldReason.CLOCK) > 40
        assert "Sources of fleet time disagree: plan held" in texts(flown, system)


def test_without_any_source_nobody_moves_and_each_says_so(tmp_path: Path) -> None:
    flown = fly(tmp_path, NO_AUTOPILOT, {"cap_s": 5.0})
    assert flown.summary["converged"] is False
    position = flown.flight.truth.samples().position
    assert abs(position - flown.flight.fleet.starts.positions).max() < 1.0
    assert all("Fleet time has no source: plan held" in texts(flown, system) for system in (11, 12, 13))


def test_links_too_slow_for_the_bound_hold_the_plan_and_say_so(tmp_path: Path) -> None:
    slow = {"companion": {"certified": {"clock_us": 20_000}}, "cap_s": 5.0}
    flown = fly(tmp_path, slow)
    assert flown.summary["converged"] is False
    assert all("Fleet time is too uncertain: plan held" in texts(flown, system) for system in (11, 12, 13))


@pytest.mark.slow
@pytest.mark.parametrize("fault", [{"kind": "freeze", "for_s": 3.0}, {"kind": "vanish"}], ids=str)
def test_the_backup_node_has_the_time_of_its_companion(fault: dict[str, Any], tmp_path: Path) -> None:
    """Also where the clock of both is off by minutes."""
    struck = {"vehicle": 12, "at_s": 1.5, **fault}
    faults = {"faults": [struck, *MINUTES], "autopilot": {"guided_timeout": 0.3}}
    flown = fly(tmp_path, faults)
    backup = flown.flight.backup_nodes
    assert backup[1].carried > 40
    assert [backup[0].carried, backup[2].carried] == [0, 0]
    assert flown.summary["converged"] is (fault["kind"] == "freeze")


@pytest.mark.slow
def test_a_run_is_certified_and_replayed_whatever_the_clocks(tmp_path: Path) -> None:
    of = scenario("antipodal-8", SWAP, {"faults": [*MINUTES, *DRIFT], "cap_s": 8.0}, DISCIPLINED)
    directory = tmp_path / "run"
    directory.mkdir()
    swarm.fly(Prepared(of, FIREFLY), 1, directory, lambda _stage, _seconds: None)
    verdict = judge(read(directory, lambda _name, _share: None))
    assert verdict.findings == ()
    assert all(history.steps for history in verdict.histories)
    for one in again(directory):
        assert one.identical, one
