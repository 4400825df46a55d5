"""Failed runs as scenario files, to be flown again after every change."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from outrider.errors import InputError
from outrider.runs import whole_file
from outrider.sweep.cells import Cell, scenario_of, scenario_text, task
from outrider.sweep.runs import Ending, Run

_MARK = "# A run of a sweep that failed"
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
    # Line breaks of an error or a label would end the YAML comment.
    why, label = (" ".join(text.split()) for text in (", ".join(words), cell.label))
    command = shlex.join(["outrider", "swarm", path.name, "--seed", str(run.seed)])
    head = f"{_MARK}: sweep {sweep}, {label}, seed {run.seed}: {why}\n# {command}\n"
    return head + scenario_text(scenario_of(task(cell, run.seed)))
