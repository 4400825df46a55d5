"""Cells of a comparison: each row as a checked scene."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from outrider.compare.comparison import Comparison, Row
from outrider.compare.mission_files import folder_of
from outrider.compare.scene import Places, Scene, document_of
from outrider.compare.worlds import folder_of as folder_of_worlds
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.simulation.preparation import prepared
from outrider.sweep.cells import Cell
from outrider.sweep.grid import overlay
from outrider.yaml_files.yaml_file import load, read
from sitl.vehicle.config import VehicleConfig

_KEY_LENGTH = 20


def cells_of(
    comparison: Comparison,
    where: Path,
    rows: Sequence[Row],
    folder: Path | None,
    worlds: Path | None = None,
    needed: Collection[str] | None = None,
    seeds: int = 1,
) -> list[Cell]:
    """Return the cell of each of ``rows``, checked; ``where`` is the comparison's file.

    ``folder``: mission files in place of drawn ones; ``worlds``: a folder of world files in place of drawn
    worlds. With either each of ``seeds`` seeds is checked, and otherwise the first one, because what is drawn
    leaves starts and goals free. ``needed``: labels of the rows that are checked; by default all are. Raises
    InputError for one that cannot be flown.
    """
    if folder is not None and comparison.missions is None:
        raise InputError(f"--missions {folder}: {comparison.name} has one mission; allowed: no --missions")
    if worlds is not None and not any(row.world or comparison.world for row in rows):
        raise InputError(f"--worlds {worlds}: {comparison.name} has no world; allowed: no --worlds")
    boxes = {} if worlds is None else folder_of_worlds(worlds)
    file = where.parent / comparison.scenario
    base: dict[str, Any] = load(file, Scenario).model_dump(mode="json")
    found = []
    for number, row in enumerate(rows, 1):
        changed = overlay(base, {**comparison.set, **row.set})
        count = int(str(changed["vehicles"]))
        given = []
        if folder is not None and comparison.missions is not None:
            given = folder_of(folder, count, comparison.measure, comparison.missions.offset)
        scene = Scene(
            scenario=changed,
            measure=comparison.measure,
            goal_radius=comparison.goal_radius,
            vehicles=count,
            missions=row.missions or comparison.missions,
            world=row.world or comparison.world,
            worlds=tuple(tuple(box.model_dump(mode="json") for box in one) for one in boxes.values()),
            given=tuple((_places(one.starts), _places(one.goals)) for one in given),
        )
        place = f"{where}: {row.label}"
        if needed is None or row.label in needed:
            from_files, names = bool(given or boxes), list(boxes)
            for seed in range(1, 1 + (seeds if from_files else 1)):
                found_at = f"{place}, seed {seed}" if from_files else place
                if names:
                    found_at += f", {names[(seed - 1) % len(names)]}"
                # Read like a file, for the same messages.
                prepared(read(json.dumps(document_of(scene, seed)).encode(), found_at, Scenario), found_at)
        document = scene.model_dump_json()
        vehicle = load(find("vehicles", str(changed["vehicle"])), VehicleConfig).model_dump_json()
        key = hashlib.sha256(json.dumps([document, vehicle]).encode()).hexdigest()[:_KEY_LENGTH]
        found.append(
            Cell(row.label, f"{number:03d}-{comparison.name}", key, document, vehicle, is_scene=False)
        )
    return found


def _places(array: Any) -> Places:
    return tuple((float(x), float(y), float(z)) for x, y, z in array)
