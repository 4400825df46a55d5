"""The cells of a sweep: each combination of the grid made into a scenario (or a scene that draws one for each
seed), checked as a whole before anything is flown, and named by the hash of all that its runs depend on."""

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
    """One combination. ``document`` is what is flown, as JSON: a scenario, or a scene if ``is_scene``.
    ``vehicle`` is that of its scenario. ``key`` is a hash of both; ``slug`` names its files."""

    label: str
    slug: str
    key: str
    document: str
    vehicle: str
    is_scene: bool


def cells(sweep: Sweep, where: str) -> list[Cell]:
    """Every cell of the sweep, checked. InputError, with a line for each fault that says which cell it is in,
    and nothing has been flown or written; ``where`` is the sweep's file."""
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
    """The run of ``cell`` with ``seed``."""
    return Task(cell.key, seed, cell.document, cell.vehicle, cell.is_scene)


def scenario_of(task: Task) -> Scenario:
    """The scenario that a task flies. A random one comes out the same each time."""
    if not task.is_scene:
        return Scenario.model_validate_json(task.document, strict=True)
    scene = Scene.model_validate_json(task.document, strict=True)
    return Scenario.model_validate_json(json.dumps(draw(scene, task.seed)), strict=True)


def scenario_text(scenario: Scenario) -> str:
    """A scenario file that loads as exactly this scenario, every number to the last bit."""
    # A wide page: no value is folded over lines.
    text: str = yaml.dump(
        scenario.model_dump(mode="json"), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=4096
    )
    return text


class _Dumper(yaml.SafeDumper):
    """Quotes whatever our own reader would not take for text: ``1E5`` is a number in YAML 1.2 and in JSON,
    but not in the YAML 1.1 that the library writes."""

    def represent_str(self, data: str) -> yaml.ScalarNode:
        """A text, quoted if it has to be."""
        try:
            is_text = resolve(data) == data
        except ScalarError:
            is_text = False
        return self.represent_scalar("tag:yaml.org,2002:str", data, style=None if is_text else "'")


_Dumper.add_representer(str, _Dumper.represent_str)


def _cell(sweep: Sweep, point: Point, number: int) -> Cell:
    if sweep.scenes:
        scene = _changed(find("scenes", point.source), Scene, point)
        # All draws are tried now: what cannot be placed must not end the sweep in its middle.
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
    """The file with the cell's changes, read again as a file is read: the same checks, the same words."""
    base = load(path, model)
    document: dict[str, JsonValue] = base.model_dump(mode="json")
    return read(json.dumps(overlay(document, point.changes)).encode(), point.label, model)


def _drawn(scene: Scene, seed: int) -> Scenario:
    text = json.dumps(draw(scene, seed))
    try:
        return Scenario.model_validate_json(text, strict=True)
    except ValidationError:
        # The slow way, for its words.
        return read(text.encode(), f"seed {seed}", Scenario)


def _flyable(scenario: Scenario) -> str:
    """Its vehicle, as JSON. Loads the scenario as ``outrider swarm`` will when a run is replayed."""
    with tempfile.TemporaryDirectory(prefix="outrider-") as folder:
        path = Path(folder) / "scenario.yaml"
        path.write_text(scenario_text(scenario), encoding="utf-8")
        prepared = prepare(str(path), Options())
    if prepared.scenario != scenario:
        raise InputError("does not come back from a file as it was")
    return prepared.vehicle.model_dump_json()


def _without_place(fault: Fault | str) -> str:
    """A fault's words without its line and column: those are of a text that the user never saw."""
    return fault.what if isinstance(fault, Fault) else fault
