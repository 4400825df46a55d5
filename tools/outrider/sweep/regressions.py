"""Failed runs as scenario files, to be flown again after every change."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from outrider.errors import InputError
from outrider.runs import whole_file
from outrider.scenarios.scenario import Scenario
from outrider.sweep.cells import Cell, scenario_of, scenario_text, task
from outrider.sweep.runs import Ending, Run

_MARK = "A run of a sweep that failed"
_KEY = 8


def prepare(folder: Path) -> None:
    """Create the ``folder`` before anything is flown. Raises InputError if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--regressions {folder}: cannot be made: {error.strerror}") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"--regressions {folder}: cannot be written to; allowed: a folder of your own")


def write(folder: Path, sweep: str, cells: Sequence[Cell], runs: Mapping[str, Sequence[Run]]) -> list[Path]:
    """Write a file to ``folder`` for each run that did not end well; return all these files, also older ones.

    The names are SWEEP-CELL-KEY-seedN.yaml, where KEY is the start of the cell's key. A file starts with the
    reason and the command that flies it. ``runs`` holds the runs of each cell by its key. An existing file
    stays, because it may have been edited. Raises InputError if a file cannot be written.
    """
    files: dict[Path, str] = {}
    for cell in cells:
        for run in runs[cell.key]:
            if run.ending is not Ending.FINE:
                path = folder / f"{sweep}-{cell.slug}-{cell.key[:_KEY]}-seed{run.seed}.yaml"
                files[path] = _text(path, sweep, cell, run)
    try:
        for path, text in files.items():
            if not path.exists():
                whole_file.write(path, text)
    except OSError as error:
        raise InputError(f"--regressions {folder}: cannot be written to: {error.strerror}") from None
    return list(files)


def _text(path: Path, sweep: str, cell: Cell, run: Run) -> str:
    words = [run.ending.value]
    if run.separation is not None:
        words.append(f"least separation {run.separation:g} m")
    if run.what:
        words.append(run.what)
    what = f"{_MARK}: sweep {sweep}, {cell.label}, seed {run.seed}: {', '.join(words)}"
    return file_text(path.name, what, run.seed, scenario_of(task(cell, run.seed)))


def file_text(name: str, what: str, seed: int, scenario: Scenario) -> str:
    """Return the text of a scenario file ``name``, which begins with ``what`` failed and how to fly it."""
    # Line breaks of an error or a label would end the YAML comment, and YAML has no unprintable characters.
    head = "".join(one for one in " ".join(what.split()) if one.isprintable())
    command = shlex.join(["outrider", "swarm", name, "--seed", str(seed)])
    return f"# {head}\n# {command}\n{scenario_text(scenario)}"
