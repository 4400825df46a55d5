"""Preparation of a scenario for flight, and flights that write no files."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import NamedTuple

from mavlink_bridge.frames import FleetFrame
from outrider.errors import Fault, InputError
from outrider.resources import config_root, find
from outrider.runs.outcome import Outcome
from outrider.runs.summary import WALL_FIELDS, Cost, Value, summarise
from outrider.scenarios.faults import MotorFailure
from outrider.scenarios.feasibility import obstacles_to
from outrider.scenarios.options import Options, apply
from outrider.scenarios.radio_range import against_range
from outrider.scenarios.scenario import RecordedTarget, Scenario
from outrider.simulation.flight import Flight
from outrider.simulation.targets import load as load_log
from outrider.yaml_files.yaml_file import load
from sitl.environment.weather import WeatherConfig
from sitl.vehicle.config import VehicleConfig


class Prepared(NamedTuple):
    """A scenario as it will be flown, with its vehicle."""

    scenario: Scenario
    vehicle: VehicleConfig


def prepare(name: str, options: Options) -> Prepared:
    """Load a scenario by name or path and apply ``options``.

    Raises InputError for a faulty file or option, and as ``prepared`` does.
    """
    path = find("scenarios", name)
    return prepared(apply(load(path, Scenario), options), str(path))


def prepared(scenario: Scenario, where: str) -> Prepared:
    """Return ``scenario`` with its vehicle, checked; faults are reported under the name ``where``.

    Raises InputError for a scenario that cannot be flown, ModuleNotFoundError if ``jsbsim`` is required and
    missing.
    """
    if isinstance(scenario.target, RecordedTarget):
        # Before a run directory is made: an unusable log then leaves none behind.
        origin = scenario.origin
        frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
        load_log(scenario.target, config_root() / "logs" / scenario.target.log, frame)
    if scenario.physics == "jsbsim":
        # A missing package, too, must be detected before a run directory is made.
        import_module("jsbsim")
    vehicle = load(find("vehicles", scenario.vehicle), VehicleConfig)
    last = len(vehicle.rotors) - 1
    wrong = [
        Fault(where, f"faults[{index}].rotor is {fault.rotor}; {scenario.vehicle} has rotors 0 to {last}")
        for index, fault in enumerate(scenario.faults)
        if isinstance(fault, MotorFailure) and fault.rotor > last
    ]
    if vehicle.motion == "point":
        wrong += [Fault(where, reason) for reason in _not_for_points(scenario)]
    wrong += [Fault(where, reason) for reason in against_range(scenario)]
    wrong += [Fault(where, reason) for reason in obstacles_to(scenario, vehicle.span)]
    if wrong:
        raise InputError(*wrong)
    return Prepared(scenario, vehicle)


def _not_for_points(scenario: Scenario) -> Iterator[str]:
    """Yield what a scenario with points has and points have not."""
    if scenario.physics != "own":
        yield f"physics is {scenario.physics!r}; {scenario.vehicle} is a point, which needs physics: own"
    if scenario.weather != WeatherConfig():
        yield f"weather is given, but {scenario.vehicle} is a point, which wind does not move"
    for index, fault in enumerate(scenario.faults):
        if isinstance(fault, MotorFailure):
            yield f"faults[{index}] is of a motor; {scenario.vehicle} is a point and has none"


def measure(prepared: Prepared, seed: int) -> dict[str, Value]:
    """Fly and return the part of the summary that the seed determines: all but ``WALL_FIELDS``.

    No files are written.
    """
    return measured(prepared, seed)[1]


def measured(prepared: Prepared, seed: int) -> tuple[Outcome, dict[str, Value]]:
    """Fly as ``measure`` does, and return also the outcome."""
    # Reading the CPU clock before and after every plan takes more than 1 % of a flight's CPU time.
    flight = Flight(*prepared, seed, config_root() / "logs", stopwatch=lambda: 0)
    flight.run()
    outcome = flight.outcome
    summary = summarise(outcome, Cost(0.0, 0.0), None)
    return outcome, {key: value for key, value in summary.items() if key not in WALL_FIELDS}
