"""The directory of a sweep, and the commands that replay its runs.

``journal.jsonl`` · ``summary.json``, ``.html``, ``.parquet`` · ``runs.parquet`` · ``sweep.png`` · ``cells/``:
scenarios as they are flown, so that a command names one exactly, whatever becomes of the shipped files ·
``replays/``: where those commands put their runs.
"""

from __future__ import annotations

import shlex
from pathlib import Path

from outrider.errors import InputError
from outrider.sweep.cells import Cell, scenario_of, scenario_text, task

JOURNAL, SUMMARY, PICTURE = "journal.jsonl", "summary.json", "sweep.png"


def prepare(out: Path | None, name: str) -> Path:
    """``out``, or ``runs/sweep-NAME``: new, empty, or begun by a sweep. The same command finds it again: that
    is how a sweep is resumed."""
    directory = out if out is not None else Path("runs") / f"sweep-{name}"
    try:
        if directory.is_dir() and any(directory.iterdir()) and not (directory / JOURNAL).is_file():
            raise InputError(
                f"--out {directory}: holds files, but no {JOURNAL}; allowed: a new or empty directory, or "
                "one of this sweep"
            )
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory}: cannot be made: {error.strerror}") from None
    return directory


def command(directory: Path, cell: Cell, seed: int) -> str:
    """The command that flies a run again and keeps its logs. Writes the scenario that it names."""
    file = directory / "cells" / (f"{cell.slug}-seed{seed}.yaml" if cell.is_scene else f"{cell.slug}.yaml")
    text = scenario_text(scenario_of(task(cell, seed)))
    file.parent.mkdir(exist_ok=True)
    file.write_text(text, encoding="utf-8")
    replay = directory / "replays" / f"{cell.slug}-seed{seed}"
    words = ["outrider", "swarm", str(file), "--seed", str(seed), "--out", str(replay)]
    return shlex.join(words)
