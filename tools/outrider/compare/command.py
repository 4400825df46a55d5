"""Command ``outrider compare``: flies a published scene, resumable, and shows ours beside the published."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from outrider.compare import failed_flights, picture, table
from outrider.compare.cells import cells_of
from outrider.compare.comparison import Comparison, Row
from outrider.compare.failed_flights import FailedFlight
from outrider.compare.flying import RUN, TRACED
from outrider.compare.physics import in_physics
from outrider.compare.results import Result, faults, result_of
from outrider.compare.scene import Scene, scenario_of
from outrider.errors import InputError
from outrider.interruption import INTERRUPTED
from outrider.resources import find
from outrider.runs import whole_file
from outrider.sweep import directory as places
from outrider.sweep.cells import Cell
from outrider.sweep.comparison import Flown, flown
from outrider.sweep.execution import WALL_LIMIT_S, header
from outrider.sweep.workers import Machines
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

DOCUMENT, MARKDOWN, PICTURE = "compare.json", "compare.md", "compare.png"


def compare(
    name: str,
    seeds: int | None = None,
    jobs: int | None = None,
    out: Path | None = None,
    as_json: bool = False,
    rows: tuple[str, ...] = (),
    missions: Path | None = None,
    worlds: Path | None = None,
    run: str = RUN,
    *,
    physics: bool = False,
    scheduler: str | None = None,
    wall_limit_s: float = WALL_LIMIT_S,
) -> int:
    """Fly the comparison ``name``, a file or a shipped one, and return the exit status.

    The status is 0 if every flight succeeded and kept its own d_min, 1 if one did not, and 3 after an
    interruption. A missed bar is a result, not an error. ``jobs``, ``scheduler``, ``wall_limit_s``: see
    ``Machines``. ``rows``: labels to fly, or beginnings of labels; by default all. The tables have
    these rows, and all others of which each seed is in the journal already. ``missions``: a
    folder with mission files of LSC's planners, in place of drawn ones; ``worlds``: one with their world
    files. ``physics``: with the vehicle of the comparison's part ``physics`` (``in_physics``). Writes
    ``compare.json``, ``compare.md`` and ``compare.png`` beside the journal in ``out`` (default
    ``runs/sweep-compare-NAME``, in full physics ``…-physics``), and the scenarios of flights that failed.
    """
    machines = Machines(jobs, scheduler, wall_limit_s)
    path = find("comparisons", name)
    comparison = load(path, Comparison)
    if physics and worlds is not None:
        raise InputError(
            "--physics does not go with --worlds: whether the vehicle has a way through a world of a file is"
            " not checked; allowed: one of them, with --physics drawn worlds"
        )
    if physics:
        comparison = in_physics(comparison, path)
    chosen = _chosen(comparison, rows)
    # The journal is that of all rows, so that some of them are flown first, and others later. A folder of
    # missions or worlds may have those of the chosen rows alone.
    rows_of = comparison.rows if missions is None and worlds is None else chosen
    # In full physics some rows may be too narrow: those that are not asked for are not checked.
    needed = {row.label for row in chosen} if physics else None
    count = seeds or comparison.seeds
    every = cells_of(comparison, path, rows_of, missions, worlds, needed, count)
    cells = {cell.label: cell for cell in every}
    title = f"compare-{comparison.name}"
    folder = places.prepare(out, title)
    numbers = range(TRACED, TRACED + count)
    of_rows = [cells[row.label] for row in chosen]
    entries = flown(header(title, every), of_rows, numbers, folder, run, machines)
    if entries is None:
        return INTERRUPTED
    shown = [row for row in rows_of if row in chosen or _is_flown(cells[row.label], entries, numbers)]
    found = [cells[row.label] for row in shown]
    results = [
        _result(comparison, row, cell, entries, numbers) for row, cell in zip(shown, found, strict=True)
    ]
    failed = [
        FailedFlight(cell, seed, wrong)
        for cell in found
        for seed in numbers
        if (wrong := faults(entries[cell.key, seed], comparison.measure))
    ]
    document = _document(comparison, results, failed)
    whole_file.write(folder / DOCUMENT, json.dumps(document, indent=2) + "\n")
    whole_file.write(folder / MARKDOWN, table.markdown(comparison, results))
    points = any(result.motion == "point" for result in results)
    _draw(comparison, found, entries, folder, points=points)
    if as_json:
        sys.stdout.write(json.dumps(document) + "\n")
    else:
        table.show(comparison, results)
    sys.stderr.write(f"table, Markdown and picture: {folder}\n")
    _report(failed, folder)
    return 1 if failed else 0


def _chosen(comparison: Comparison, labels: tuple[str, ...]) -> tuple[Row, ...]:
    """Return the rows whose labels begin with one of ``labels``; all without labels."""
    known = ", ".join(row.label for row in comparison.rows)
    for label in labels:
        if not any(row.label.startswith(label) for row in comparison.rows):
            raise InputError(f"--row {label}: {comparison.name} has no such row; rows are {known}")
    return tuple(
        row for row in comparison.rows if not labels or any(row.label.startswith(label) for label in labels)
    )


def _is_flown(cell: Cell, entries: Flown, numbers: range) -> bool:
    """Return whether the journal has a flight of ``cell`` with each seed of ``numbers``."""
    return all((cell.key, seed) in entries for seed in numbers)


def _result(comparison: Comparison, row: Row, cell: Cell, entries: Flown, numbers: range) -> Result:
    scene = Scene.model_validate_json(cell.document)
    vehicle = VehicleConfig.model_validate_json(cell.vehicle, strict=True)
    of_row = [entries[cell.key, seed] for seed in numbers]
    return result_of(comparison, row, scene.scenario["links"], (vehicle.name, vehicle.motion), of_row)


def _document(
    comparison: Comparison, results: Sequence[Result], failed: Sequence[FailedFlight]
) -> dict[str, Any]:
    """Return the results, the published figures of their rows, and what failed, as values of JSON."""
    labels = {result.row for result in results}
    return {
        "comparison": comparison.name,
        "description": comparison.description,
        "measure": comparison.measure.model_dump(),
        "goal_radius_m": comparison.goal_radius,
        "rows": [result.document() for result in results],
        "published": [one.model_dump() for one in comparison.published if one.row in labels],
        "differences": list(comparison.unlike),
        "failed": [{"row": one.cell.label, "seed": one.seed, "faults": one.faults} for one in failed],
    }


def _report(failed: Sequence[FailedFlight], folder: Path) -> None:
    """Name the flights that failed, and write their scenarios."""
    for one in failed:
        sys.stderr.write(f"failed: {one.text}\n")
    if files := failed_flights.write(folder, failed):
        sys.stderr.write(f"scenarios of {len(files)} failed flights: {folder / failed_flights.FOLDER}\n")


def _draw(comparison: Comparison, found: list[Cell], entries: Flown, folder: Path, *, points: bool) -> None:
    panels = {}
    for cell in found:
        summary = entries[cell.key, TRACED].summary
        if summary is not None and "trace" in summary:
            scenario = scenario_of(Scene.model_validate_json(cell.document), TRACED)
            moving = np.array(summary.get("moving", [])), [one.radius for one in scenario.moving]
            panels[cell.label] = picture.Paths(np.array(summary["trace"]), scenario.obstacles, *moving)
    if panels:
        kind = ", points without physics" if points else ""
        title = f"{comparison.name}, seed {TRACED}{kind}: paths from above"
        picture.draw(title, panels, folder / PICTURE)
