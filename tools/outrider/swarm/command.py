"""``outrider swarm``: flies a scenario and writes its logs, summary and figure into a run directory."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from outrider.interruption import interruptible
from outrider.resources import config_root
from outrider.runs import figures, names
from outrider.runs.configuration import write_scenario
from outrider.runs.directories import new_directory
from outrider.runs.flight_file import write_flight, write_plan_times, write_plans
from outrider.runs.outcome import Outcome
from outrider.runs.summary import Cost, Value, summarise, write
from outrider.scenarios.scenario import Scenario
from outrider.simulation.flight import Flight, Progress
from outrider.simulation.preparation import Prepared

if TYPE_CHECKING:
    from outrider.swarm.show import FlightView

__all__ = [
    "LOCK_STEP",
    "Pace",
    "fly",
    "run_directory",
]


class Pace(NamedTuple):
    """Pace of a flight: lock-step in so many ``processes``, or real time with one process per node.

    With ``priority`` the processes of a flight in real time request real-time priority.
    """

    real_time: bool = False
    priority: bool = False
    processes: int = 1


LOCK_STEP = Pace()


def fly(
    prepared: Prepared,
    seed: int,
    directory: Path,
    progress: Progress,
    pace: Pace = LOCK_STEP,
    show: FlightView | None = None,
) -> dict[str, Value]:
    """Fly the scenario, and return the summary.

    Logs, the resolved configuration, plans, truth, summary and figure are written to ``directory``; ``show``
    displays the flight. Raises OutriderError if the flight is interrupted.
    """
    with interruptible(f"{directory} keeps the configuration and the logs up to there, but no summary"):
        scenario = prepared.scenario
        write_scenario(directory, seed, scenario)
        if pace.real_time:
            outcome, cost = _flown_in_real_time(prepared, seed, progress, directory, pace, show)
        else:
            outcome, cost = _flown(prepared, seed, progress, directory, show, pace.processes)
        if show is not None:
            show.orders.write(directory)
        summary = summarise(outcome, cost, directory)
        write(summary, directory / names.SUMMARY)
        write_plans(outcome, directory / names.PLANS)
        write_flight(outcome, directory / names.FLIGHT)
        write_plan_times(outcome, directory / names.PLAN_TIMES)
        figures.draw(outcome, summary, directory / "flight.png")
        return summary


def _flown(
    prepared: Prepared,
    seed: int,
    progress: Progress,
    directory: Path,
    show: FlightView | None,
    processes: int,
) -> tuple[Outcome, Cost]:
    wall, cpu = time.perf_counter(), time.process_time()
    flight = Flight(
        *prepared,
        seed,
        config_root() / "logs",
        progress=progress,
        run_directory=directory,
        onlooker=None if show is None else show.lock_step(prepared, seed),
        processes=processes,
    )
    flight.run()
    spent = time.process_time() - cpu + flight.cpu_of_others
    return flight.outcome, Cost(time.perf_counter() - wall, spent)


def _flown_in_real_time(
    prepared: Prepared, seed: int, progress: Progress, directory: Path, pace: Pace, show: FlightView | None
) -> tuple[Outcome, Cost]:
    from outrider.realtime.flight import RealTimeFlight

    wall, cpu = time.perf_counter(), _cpu_of_all()
    flight = RealTimeFlight(
        *prepared,
        seed,
        config_root() / "logs",
        directory,
        progress,
        priority=pace.priority,
        view=None if show is None else show.real_time(prepared, seed),
    )
    flight.run()
    if flight.priority_told:
        sys.stderr.write(f"{flight.priority_told}\n")
    return flight.outcome, Cost(time.perf_counter() - wall, _cpu_of_all() - cpu)


def _cpu_of_all() -> float:
    """Return the CPU time (s) of this process and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def run_directory(out: Path | None, scenario: Scenario, seed: int, changes: str = "") -> Path:
    """Return a new, empty directory: ``out``, or the first free ``runs/NAME-METHOD[-CHANGES]-seedN[-k]``.

    Nothing is overwritten. Raises InputError if ``out`` is not empty.
    """
    certified = scenario.companion.avoidance == "certified"
    way = "certified" if certified else "+".join(scenario.companion.methods)
    changed = f"-{changes}" if changes else ""
    return new_directory(out, f"{scenario.name}-{way}{changed}-seed{seed}")
