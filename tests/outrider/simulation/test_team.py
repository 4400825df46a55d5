"""Flights in several processes: the bytes of one process, and errors that say what is wrong."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from outrider.errors import InputError, OutriderError
from outrider.runs.summary import WALL_FIELDS, Cost, summarise
from outrider.scenarios.scenario import Scenario
from outrider.scene.changes import Change
from outrider.simulation.flight import Flight
from tests.outrider.shipped import FIREFLY, LOGS, scenario

SHORT: dict[str, Any] = {"vehicles": 5, "airborne": True, "cap_s": 4.0}
ROUGH: dict[str, Any] = {
    "links": {"swarm": {"loss": 0.2, "jitter_ms": 10.0, "duplication": 0.05, "reordering": 0.1}},
    "sensors": "rtk",
    "faults": [
        {"kind": "freeze", "vehicle": 13, "at_s": 0.503, "for_s": 0.4},
        {"kind": "clock", "vehicle": 12, "late_ms": 800.0, "drift_ppm": 50.0},
        {"kind": "gps_loss", "vehicle": 14, "at_s": 1.0, "for_s": 1.0},
        {"kind": "vanish", "vehicle": 15, "at_s": 2.001},
    ],
    "partitions": [{"at_s": 0.213, "for_s": 1.031, "members": [11, 13]}],
}
FLIGHTS: dict[str, dict[str, Any]] = {
    "calm": {},
    "rough": ROUGH,
    "certified": {"companion": {"avoidance": "certified", "turning_sense": "right"}, "cap_s": 3.0},
}
# Of five vehicles three processes have unequal parts.
NUMBERS = {"calm": (2, 3), "rough": (2, 3), "certified": (3,)}


def flown(of: Scenario, processes: int, directory: Path, **options: Any) -> tuple[Flight, dict[str, bytes]]:
    """A flight, and the bytes of its logs."""
    directory.mkdir()
    flight = Flight(
        of,
        FIREFLY,
        3,
        LOGS,
        run_directory=directory,
        stopwatch=lambda: 0,
        processes=processes,
        **options,
    )
    flight.run()
    return flight, {path.name: path.read_bytes() for path in sorted(directory.iterdir())}


def figures(flight: Flight) -> dict[str, object]:
    """The summary without what the machine determines."""
    summary = summarise(flight.outcome, Cost(0.0, 0.0), None)
    return {key: value for key, value in summary.items() if key not in WALL_FIELDS}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "calm" else []) for name in FLIGHTS]
)
def test_any_number_of_processes_gives_the_same_bytes(name: str, tmp_path: Path) -> None:
    of = scenario("antipodal-8", **{**SHORT, **FLIGHTS[name]})
    one, logs = flown(of, 1, tmp_path / "1")
    assert len(logs) == 2 * of.size
    for processes in NUMBERS[name]:
        other, found = flown(of, processes, tmp_path / str(processes))
        assert found == logs
        assert repr(figures(other)) == repr(figures(one))
        for a, b in zip(one.truth.samples(), other.truth.samples(), strict=True):
            np.testing.assert_array_equal(a, b)
        for mine, theirs in zip(one.outcome.plan_logs, other.outcome.plan_logs, strict=True):
            np.testing.assert_array_equal(mine.gradients, theirs.gradients)


class Meddler:
    """Onlooker that changes the flight, and keeps what it sees."""

    def __init__(self) -> None:
        self.seen: list[str] = []

    def __call__(self, flight: Flight, now: int) -> None:
        """Change methods, loss and target after a second."""
        self.seen.append(repr(flight.snapshots(now)))
        if len(self.seen) == 50:
            flight.change(now, Change("baseline", 0.5, (3.0, 0.0, 5.0)))


@pytest.mark.slow
def test_what_a_viewer_sees_and_changes_is_the_same(tmp_path: Path) -> None:
    of = scenario("antipodal-8", **SHORT)
    views, logs = [], []
    for processes in (1, 2):
        view = Meddler()
        logs.append(flown(of, processes, tmp_path / str(processes), onlooker=view)[1])
        views.append(view.seen)
    assert logs[0] == logs[1]
    assert views[0] == views[1]
    assert logs[0] != flown(of, 1, tmp_path / "unchanged")[1]


def test_more_processes_than_vehicles_are_refused() -> None:
    with pytest.raises(InputError, match="is 6; allowed: 1 to 5, the number of vehicles"):
        Flight(scenario("antipodal-8", **SHORT), FIREFLY, 1, LOGS, processes=6)


def test_a_link_that_is_faster_than_the_exchange_is_refused() -> None:
    of = scenario("antipodal-8", **SHORT, links={"swarm": {"delay_ms": 5.0}})
    with pytest.raises(InputError, match=r"a delay of 5 ms; allowed: 20 ms or more"):
        Flight(of, FIREFLY, 1, LOGS, processes=2)


def test_a_process_that_is_killed_ends_the_flight_with_an_error(tmp_path: Path) -> None:
    def kill(flight: Flight, _now: int) -> None:
        for process in flight._team._children._processes.values():
            if process.pid is not None:
                os.kill(process.pid, signal.SIGKILL)

    with pytest.raises(OutriderError, match="process 1 of 2 of the flight ended"):
        flown(scenario("antipodal-8", **SHORT), 2, tmp_path / "killed", onlooker=kill)


def test_a_fault_in_another_process_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes are forked: they have the patched function."""
    parent = os.getpid()

    def broken(*_args: object) -> None:
        if os.getpid() != parent:
            raise ZeroDivisionError("for the test")

    monkeypatch.setattr("outrider.simulation.team.obey", broken)
    with pytest.raises(OutriderError, match=r"(?s)process 1 of 2 of the flight failed.*for the test"):
        flown(scenario("antipodal-8", **SHORT), 2, tmp_path / "broken")


def test_a_process_that_cannot_start_ends_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    fork, children = os.fork, []

    def scarce() -> int:
        if children:
            raise BlockingIOError(11, "Resource temporarily unavailable")
        child = fork()
        children.append(child)
        return child

    flight = Flight(scenario("antipodal-8", **SHORT), FIREFLY, 3, LOGS, processes=3)
    monkeypatch.setattr(os, "fork", scarce)
    with pytest.raises(BlockingIOError):
        flight.run()
    with pytest.raises(ChildProcessError):
        os.waitpid(children[0], os.WNOHANG)
