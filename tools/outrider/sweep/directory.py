"""Directory of a sweep, and the commands that replay its runs.

``journal.jsonl`` · ``summary.json``, ``.html``, ``.parquet`` · ``runs.parquet`` · ``sweep.png`` · ``cells/``:
scenarios as flown, so that the commands do not depend on the shipped files · ``replays/``: the run
directories of the commands.
"""

from __future__ import annotations

import shlex
from pathlib import Path

from outrider.errors import InputError
from outrider.sweep.cells import Cell, scenario_of, scenario_text, task

JOURNAL, SUMMARY, PICTURE = "journal.jsonl", "summary.json", "sweep.png"


def prepare(out: Path | None, name: str) -> Path:
    """Return the directory ``out``, or ``runs/sweep-NAME``: new, empty, or that of a sweep.

    The same command finds the directory again and so resumes the sweep. Raises InputError if it holds files
    but no journal, or cannot be created.
    """
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
    """Return the command that flies a run again and keeps its logs, and write the scenario that it names."""
    file = directory / "cells" / (f"{cell.slug}-seed{seed}.yaml" if cell.is_scene else f"{cell.slug}.yaml")
    text = scenario_text(scenario_of(task(cell, seed)))
    file.parent.mkdir(exist_ok=True)
    file.write_text(text, encoding="utf-8")
    replay = directory / "replays" / f"{cell.slug}-seed{seed}"
    words = ["outrider", "swarm", str(file), "--seed", str(seed), "--out", str(replay)]
    return shlex.join(words)
