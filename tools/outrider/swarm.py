"""``outrider swarm``: a scenario, changed by options, flown, summarised and drawn into a run directory."""

from __future__ import annotations

import os
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import yaml

from mavlink_bridge.frames import FleetFrame
from outrider.errors import Fault, InputError
from outrider.interruption import interruptible
from outrider.resources import config_root, find
from outrider.runs import figures
from outrider.runs.directories import new_directory
from outrider.runs.flight_file import write_flight, write_plan_times
from outrider.runs.outcome import Outcome
from outrider.runs.plans_file import write_plans
from outrider.runs.summary import WALL_FIELDS, Cost, Value, summarise, write
from outrider.scenarios.faults import MotorFailure
from outrider.scenarios.options import METHODS, Options, apply
from outrider.scenarios.scenario import RecordedTarget, Scenario
from outrider.simulation.flight import Flight, Progress
from outrider.simulation.targets import load as load_log
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

if TYPE_CHECKING:
    from outrider.view.show import Show

__all__ = [
    "LOCK_STEP",
    "METHODS",
    "Options",
    "Pace",
    "Prepared",
    "apply",
    "fly",
    "measure",
    "measured",
    "prepare",
    "run_directory",
]


class Pace(NamedTuple):
    """In lock-step, or in real time with one process per node, and those with real-time ``priority``."""

    real_time: bool = False
    priority: bool = False


LOCK_STEP = Pace()


class Prepared(NamedTuple):
    """A scenario as it will be flown, with its vehicle."""

    scenario: Scenario
    vehicle: VehicleConfig


def prepare(name: str, options: Options) -> Prepared:
    """Load a scenario by name or path and apply ``options``. InputError in one line for whatever is wrong."""
    path = find("scenarios", name)
    scenario = apply(load(path, Scenario), options)
    if isinstance(scenario.target, RecordedTarget):
        # Before a run directory is made: a log that cannot be used leaves none behind.
        origin = scenario.origin
        frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
        load_log(scenario.target, config_root() / "logs" / scenario.target.log, frame)
    if scenario.physics == "jsbsim":
        # Nor does a package that is missing.
        import_module("jsbsim")
    vehicle = load(find("vehicles", scenario.vehicle), VehicleConfig)
    last = len(vehicle.rotors) - 1
    wrong = [
        Fault(str(path), f"faults[{index}].rotor is {fault.rotor}; {scenario.vehicle} has rotors 0 to {last}")
        for index, fault in enumerate(scenario.faults)
        if isinstance(fault, MotorFailure) and fault.rotor > last
    ]
    if wrong:
        raise InputError(*wrong)
    return Prepared(scenario, vehicle)


def fly(
    prepared: Prepared,
    seed: int,
    directory: Path,
    progress: Progress,
    pace: Pace = LOCK_STEP,
    show: Show | None = None,
) -> dict[str, Value]:
    """Fly it, and leave logs, the resolved configuration, the summary and the picture in ``directory``;
    ``show`` it meanwhile. OutriderError if somebody stops it."""
    with interruptible(f"{directory} keeps the configuration and the logs up to there, but no summary"):
        scenario = prepared.scenario
        resolved = {"seed": seed, "scenario": scenario.model_dump(mode="json")}
        (directory / "configuration.yaml").write_text(
            yaml.safe_dump(resolved, sort_keys=False, allow_unicode=True), encoding="utf-8"
        )
        if pace.real_time:
            outcome, cost = _flown_in_real_time(prepared, seed, progress, directory, pace, show)
        else:
            outcome, cost = _flown(prepared, seed, progress, directory, show)
        if show is not None:
            show.orders.write(directory)
        summary = summarise(outcome, cost, directory)
        write(summary, directory / "summary.json")
        write_plans(outcome, directory / "plans.npz")
        write_flight(outcome, directory / "flight.npz")
        write_plan_times(outcome, directory / "plan_times.npz")
        figures.draw(outcome, summary, directory / "flight.png")
        return summary


def measure(prepared: Prepared, seed: int) -> dict[str, Value]:
    """Fly it for what its seed decides: no files, and of the summary all but ``WALL_FIELDS``."""
    return measured(prepared, seed)[1]


def measured(prepared: Prepared, seed: int) -> tuple[Outcome, dict[str, Value]]:
    """As ``measure``, with all that is left of the flight."""
    # Reading the CPU clock before and after every plan costs more than a hundredth of a flight.
    flight = Flight(*prepared, seed, config_root() / "logs", stopwatch=lambda: 0)
    flight.run()
    outcome = flight.outcome
    summary = summarise(outcome, Cost(0.0, 0.0), None)
    return outcome, {key: value for key, value in summary.items() if key not in WALL_FIELDS}


def _flown(
    prepared: Prepared, seed: int, progress: Progress, directory: Path, show: Show | None
) -> tuple[Outcome, Cost]:
    wall, cpu = time.perf_counter(), time.process_time()
    flight = Flight(
        *prepared,
        seed,
        config_root() / "logs",
        progress=progress,
        run_directory=directory,
        onlooker=None if show is None else show.lock_step(prepared, seed),
    )
    flight.run()
    return flight.outcome, Cost(time.perf_counter() - wall, time.process_time() - cpu)


def _flown_in_real_time(
    prepared: Prepared, seed: int, progress: Progress, directory: Path, pace: Pace, show: Show | None
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
    """CPU time (s) of this process and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def run_directory(out: Path | None, scenario: Scenario, seed: int) -> Path:
    """A new, empty directory: ``out``, or the first free ``runs/NAME-METHOD-seedN[-k]``. Nothing is
    overwritten."""
    certified = scenario.companion.avoidance == "certified"
    way = "certified" if certified else "+".join(scenario.companion.methods)
    return new_directory(out, f"{scenario.name}-{way}-seed{seed}")
