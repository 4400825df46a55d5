"""Flights of several cells and seeds for a table or for pictures: complete, resumable, with progress."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from outrider.processes.cores import cores
from outrider.sweep import directory as places
from outrider.sweep.cells import Cell, task
from outrider.sweep.execution import WALL_LIMIT_S, has_ended, work
from outrider.sweep.journal import Header, opened
from outrider.sweep.pool import Pool
from outrider.sweep.progress import watching
from outrider.sweep.tasks import Entry

Flown = dict[tuple[str, int], Entry]
"""Entries by the cell's key and the seed."""


def flown(
    of: Header, found: Sequence[Cell], seeds: Sequence[int], folder: Path, run: str, jobs: int | None
) -> Flown | None:
    """Fly each cell with each of ``seeds`` by ``run`` (``module:function``) in ``jobs`` processes.

    The journal with the header ``of`` is in ``folder``. Returns the entries, or None after an interruption,
    which is reported.
    """
    with opened(folder / places.JOURNAL, of) as journal:
        tasks = [task(cell, seed) for seed in seeds for cell in found]
        waiting = [one for one in tasks if not has_ended(journal, one)]
        with (
            watching(len(tasks), len(tasks) - len(waiting)) as watch,
            Pool(run, jobs or cores(), WALL_LIMIT_S) as pool,
        ):
            stopped = work(journal, waiting, watch, pool)
        if not stopped:
            return dict(journal.entries)
        left = sum(not has_ended(journal, one) for one in tasks)
    sys.stderr.write(
        f"stopped with {left} of {len(tasks)} flights left; the same command with --out {folder} goes on\n"
    )
    return None
