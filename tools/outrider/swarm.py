"""``outrider swarm``: a scenario, changed by options, flown, summarised and drawn into a run directory."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import NamedTuple

import yaml
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from mavlink_bridge.frames import FleetFrame
from outrider import figures
from outrider.errors import InputError
from outrider.flight import Flight, Progress
from outrider.outcome import Outcome
from outrider.resources import config_root, find
from outrider.scenario import RecordedTarget, Scenario
from outrider.summary import Cost, Value, summarise, write
from outrider.targets import load as load_log
from outrider.yaml_file import load
from sitl.config import VehicleConfig

METHODS = ("baseline", "tangential")


class Options(NamedTuple):
    """What the command line changes in a scenario; None leaves the file's value."""

    method: str | None = None
    avoidance: str | None = None
    planar: bool = False
    vehicles: int | None = None
    loss: float | None = None
    delay_ms: float | None = None
    sensors: str | None = None
    replan_hz: float | None = None
    wind: str | None = None


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
    scenario = load(find("scenarios", name), Scenario)
    scenario = apply(scenario, options)
    if isinstance(scenario.target, RecordedTarget):
        # Before a run directory is made: a log that cannot be used leaves none behind.
        origin = scenario.origin
        frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
        load_log(scenario.target, config_root() / "logs" / scenario.target.log, frame)
    return Prepared(scenario, load(find("vehicles", scenario.vehicle), VehicleConfig))


def apply(scenario: Scenario, options: Options) -> Scenario:
    """The scenario with the options' changes, checked as a whole again."""
    changes: dict[str, object] = {}
    companion: dict[str, object] = {}
    if options.method is not None:
        companion["methods"] = _methods(options.method)
    if options.avoidance not in (None, "field"):
        raise InputError(f"--avoidance {options.avoidance}: allowed is 'field'")
    if options.planar:
        companion["planar"] = True
    if options.vehicles is not None:
        changes["vehicles"] = options.vehicles
    if options.sensors is not None:
        changes["sensors"] = options.sensors
    if options.wind is not None:
        changes["weather"] = {**scenario.weather.model_dump(), "wind": _wind(options.wind)}
    if options.replan_hz is not None:
        if not 0.1 <= options.replan_hz <= 1000.0:
            raise InputError(f"--replan-hz {options.replan_hz}: allowed are 0.1 to 1000")
        companion["rates"] = {
            **scenario.companion.rates.model_dump(),
            "replan_us": round(1e6 / options.replan_hz),
        }
    if options.loss is not None or options.delay_ms is not None:
        links = scenario.links.model_dump()
        for link in ("swarm", "target"):
            if options.loss is not None:
                links[link]["loss"] = options.loss
            if options.delay_ms is not None:
                links[link]["delay_ms"] = options.delay_ms
        changes["links"] = links
    if companion:
        changes["companion"] = {**scenario.companion.model_dump(), **companion}
    if not changes:
        return scenario
    try:
        return Scenario.model_validate({**scenario.model_dump(), **changes})
    except ValidationError as error:
        # An option may stand for several links: its fault is one.
        raise InputError(*dict.fromkeys(map(_option_fault, error.errors()))) from None


def _option_fault(error: ErrorDetails) -> str:
    if not error["loc"]:
        return f"options: {error['msg']}"
    name = str(error["loc"][-1])
    option = "--replan-hz" if name == "replan_us" else f"--{name.replace('_', '-')}"
    return f"{option} ({name} = {error['input']!r}): {error['msg']}"


def fly(
    prepared: Prepared, seed: int, directory: Path, progress: Progress, pace: Pace = LOCK_STEP
) -> dict[str, Value]:
    """Fly it, and leave logs, the resolved configuration, the summary and the picture in ``directory``."""
    scenario = prepared.scenario
    resolved = {"seed": seed, "scenario": scenario.model_dump(mode="json")}
    (directory / "configuration.yaml").write_text(
        yaml.safe_dump(resolved, sort_keys=False, allow_unicode=True), encoding="utf-8"
    )
    if pace.real_time:
        outcome, cost = _flown_in_real_time(prepared, seed, progress, directory, pace)
    else:
        outcome, cost = _flown(prepared, seed, progress, directory)
    summary = summarise(outcome, cost, directory)
    write(summary, directory / "summary.json")
    figures.draw(outcome, summary, directory / "flight.png")
    return summary


def measure(prepared: Prepared, seed: int) -> dict[str, Value]:
    """Fly it for its summary alone: no files."""
    outcome, cost = _flown(prepared, seed, lambda _stage, _seconds: None, None)
    return summarise(outcome, cost, None)


def _flown(prepared: Prepared, seed: int, progress: Progress, directory: Path | None) -> tuple[Outcome, Cost]:
    wall, cpu = time.perf_counter(), time.process_time()
    flight = Flight(*prepared, seed, config_root() / "logs", progress=progress, run_directory=directory)
    flight.run()
    return flight.outcome, Cost(time.perf_counter() - wall, time.process_time() - cpu)


def _flown_in_real_time(
    prepared: Prepared, seed: int, progress: Progress, directory: Path, pace: Pace
) -> tuple[Outcome, Cost]:
    from outrider.realtime.flight import RealTimeFlight

    wall, cpu = time.perf_counter(), _cpu_of_all()
    flight = RealTimeFlight(
        *prepared, seed, config_root() / "logs", directory, progress, priority=pace.priority
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
    if out is not None:
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError(f"--out {out}: exists and is not an empty directory")
        return _made(out)
    stem = f"{scenario.name}-{'+'.join(scenario.companion.methods)}-seed{seed}"
    runs = _made(Path("runs"))
    number = 1
    while not _is_new(path := runs / (stem if number == 1 else f"{stem}-{number}")):
        number += 1
    return path


def _is_new(path: Path) -> bool:
    """Make it and say True, or False if it is there: two runs that start at once never share one."""
    try:
        path.mkdir()
    except FileExistsError:
        return False
    except OSError as error:
        raise InputError(f"{path}: cannot be made: {error.strerror}") from None
    return True


def _made(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made: {error.strerror}") from None
    return path


def _wind(text: str) -> list[float]:
    """``V`` m/s towards east, or ``EAST,NORTH`` or ``EAST,NORTH,UP``."""
    try:
        parts = [float(word) for word in text.split(",")]
    except ValueError:
        parts = []
    if not 1 <= len(parts) <= 3:
        raise InputError(
            f"--wind {text}: allowed is a speed in m/s (towards east), or EAST,NORTH or EAST,NORTH,UP"
        )
    return parts + [0.0] * (3 - len(parts))


def _methods(text: str) -> tuple[str, ...]:
    names = tuple(text.split("+"))
    for name in names:
        if name not in METHODS:
            raise InputError(
                f"--method {text}: {name!r} is no method; allowed are {', '.join(METHODS)}, joined by +"
            )
    if len(set(names)) < len(names):
        raise InputError(f"--method {text}: a method is there twice; allowed: once")
    return names
