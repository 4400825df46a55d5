"""Function that a worker runs for a task: the flight, and the machine-independent part of its summary."""

from __future__ import annotations

from functools import lru_cache

from outrider.runs.summary import Value
from outrider.scenarios.scenario import Scenario
from outrider.simulation.preparation import Prepared, measure
from outrider.sweep.cells import scenario_of
from outrider.sweep.tasks import Task
from sitl.vehicle.config import VehicleConfig

RUN = f"{__name__}:fly"
"""Name by which a worker finds `fly`."""


def fly(task: Task) -> dict[str, Value]:
    """Fly a task without files and return its summary. The same task gives the same summary."""
    return measure(prepared(task), task.seed)


def prepared(task: Task) -> Prepared:
    """Return the scenario and the vehicle of a task."""
    return Prepared(_scenario(task), _vehicle(task.vehicle))


def _scenario(task: Task) -> Scenario:
    # A scenario is the same for all seeds of its cell; a scene draws another one for each seed.
    return scenario_of(task) if task.is_scene else _fixed(task._replace(seed=0))


@lru_cache(maxsize=64)
def _fixed(task: Task) -> Scenario:
    return scenario_of(task)


@lru_cache(maxsize=64)
def _vehicle(document: str) -> VehicleConfig:
    return VehicleConfig.model_validate_json(document, strict=True)
