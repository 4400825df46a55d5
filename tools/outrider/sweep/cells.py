"""Cells of a sweep: each combination of the grid as a checked scenario or scene.

A scene draws a scenario for each seed. All cells are checked before anything is flown. The key of a cell is a
hash of its scenario (or scene) and its vehicle; seeds and software versions are not part of it.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from pathlib import Path
from typing import NamedTuple, TypeVar

import yaml
from pydantic import BaseModel, JsonValue, ValidationError

from outrider.errors import Fault, InputError
from outrider.resources import find
from outrider.scenarios.options import Options
from outrider.scenarios.scenario import Scenario
from outrider.simulation.preparation import prepare
from outrider.sweep.draw import draw
from outrider.sweep.grid import Point, Sweep, overlay, points
from outrider.sweep.scenes import Scene
from outrider.sweep.tasks import Task
from outrider.yaml_files.scalars import ScalarError, resolve
from outrider.yaml_files.yaml_file import load, read

Model = TypeVar("Model", bound=BaseModel)
_KEY_LENGTH = 20


class Cell(NamedTuple):
    """One combination of the grid.

    ``document`` is the scenario, or the scene if ``is_scene``, as JSON. ``vehicle`` is the vehicle of the
    scenario as JSON. ``key`` is a hash of both; ``slug`` names its files.
    """

    label: str
    slug: str
    key: str
    document: str
    vehicle: str
    is_scene: bool


def cells(sweep: Sweep, where: str) -> list[Cell]:
    """Return every cell of the sweep, checked; ``where`` is the sweep's file.

    Raises InputError, with a line for each fault and its cell, before anything is flown or written.
    """
    found: list[Cell] = []
    faults: list[Fault | str] = []
    for number, point in enumerate(points(sweep), 1):
        try:
            found.append(_cell(sweep, point, number))
        except InputError as error:
            faults += [Fault(where, f"cell {point.label!r}: {_without_place(f)}") for f in error.faults]
    if faults:
        raise InputError(*dict.fromkeys(faults))
    labels: dict[str, str] = {}
    for cell in found:
        if cell.key in labels:
            raise InputError(
                Fault(
                    where, f"cells {labels[cell.key]!r} and {cell.label!r} are the same; allowed: each once"
                )
            )
        labels[cell.key] = cell.label
    return found


def task(cell: Cell, seed: int) -> Task:
    """Return the run of ``cell`` with ``seed``."""
    return Task(cell.key, seed, cell.document, cell.vehicle, cell.is_scene)


def waits_for_others(cell: Cell) -> bool:
    """Return whether the runs of ``cell`` wait only for vehicles whose companion does not end for good."""
    document = json.loads(cell.document)
    values = document["scenario"] if cell.is_scene else document
    return bool(values.get("arrival") == "others")


def scenario_of(task: Task) -> Scenario:
    """Return the scenario that a task flies. A random scenario is the same each time."""
    if not task.is_scene:
        return Scenario.model_validate_json(task.document, strict=True)
    scene = Scene.model_validate_json(task.document, strict=True)
    return Scenario.model_validate_json(json.dumps(draw(scene, task.seed)), strict=True)


def scenario_text(scenario: Scenario) -> str:
    """Return a scenario file that loads as exactly this scenario, with every number exact to the last bit."""
    # The large width keeps every value on one line.
    text: str = yaml.dump(
        scenario.model_dump(mode="json"), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=4096
    )
    return text


class _Dumper(yaml.SafeDumper):
    """YAML dumper that quotes every text that the project's own reader would not read as text.

    For example, ``1E5`` is a number in YAML 1.2 and in JSON, but not in YAML 1.1, which the library writes.
    """

    def represent_str(self, data: str) -> yaml.ScalarNode:
        """Return the node of a text, quoted if necessary."""
        try:
            is_text = resolve(data) == data
        except ScalarError:
            is_text = False
        return self.represent_scalar("tag:yaml.org,2002:str", data, style=None if is_text else "'")


_Dumper.add_representer(str, _Dumper.represent_str)


def _cell(sweep: Sweep, point: Point, number: int) -> Cell:
    if sweep.scenes:
        scene = _changed(find("scenes", point.source), Scene, point)
        # All scenarios are drawn now, so that a lack of room is an error before the first flight.
        drawn = [_drawn(scene, seed) for seed in sweep.seeds]
        name, document = scene.name, scene.model_dump_json()
        vehicle = _flyable(drawn[0])
    else:
        scenario = _changed(find("scenarios", point.source), Scenario, point)
        name, document = scenario.name, scenario.model_dump_json()
        vehicle = _flyable(scenario)
    canonical = json.dumps([json.loads(document), json.loads(vehicle)], sort_keys=True)
    key = hashlib.sha256(canonical.encode()).hexdigest()[:_KEY_LENGTH]
    return Cell(point.label, f"{number:03d}-{name}", key, document, vehicle, bool(sweep.scenes))


def _changed(path: Path, model: type[Model], point: Point) -> Model:
    """Return the file with the cell's changes, read again like a file, with the same checks and messages."""
    base = load(path, model)
    document: dict[str, JsonValue] = base.model_dump(mode="json")
    return read(json.dumps(overlay(document, point.changes)).encode(), point.label, model)


def _drawn(scene: Scene, seed: int) -> Scenario:
    text = json.dumps(draw(scene, seed))
    try:
        return Scenario.model_validate_json(text, strict=True)
    except ValidationError:
        # Slower, but with the messages of a file.
        return read(text.encode(), f"seed {seed}", Scenario)


def _flyable(scenario: Scenario) -> str:
    """Return the scenario's vehicle as JSON.

    The scenario is written to a file and loaded as ``outrider swarm`` does when a run is replayed. Raises
    InputError if this changes the scenario.
    """
    with tempfile.TemporaryDirectory(prefix="outrider-") as folder:
        path = Path(folder) / "scenario.yaml"
        path.write_text(scenario_text(scenario), encoding="utf-8")
        prepared = prepare(str(path), Options())
    if prepared.scenario != scenario:
        raise InputError("the scenario changes when it is written to a file and loaded again")
    return prepared.vehicle.model_dump_json()


def _without_place(fault: Fault | str) -> str:
    """Return a fault without its line and column, which refer to a text that the user has not seen."""
    return fault.what if isinstance(fault, Fault) else fault
