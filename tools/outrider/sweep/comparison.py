"""Flights of several cells and seeds for a table or for pictures: complete, resumable, with progress."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from outrider.sweep import directory as places
from outrider.sweep.cells import Cell, task
from outrider.sweep.execution import has_ended, work
from outrider.sweep.journal import Header, opened
from outrider.sweep.progress import watching
from outrider.sweep.tasks import Entry
from outrider.sweep.workers import Machines

Flown = dict[tuple[str, int], Entry]
"""Entries by the cell's key and the seed."""


def flown(
    of: Header, found: Sequence[Cell], seeds: Sequence[int], folder: Path, run: str, machines: Machines
) -> Flown | None:
    """Fly each cell with each of ``seeds`` by ``run`` (``module:function``) on ``machines``.

    The journal with the header ``of`` is in ``folder``. Returns the entries, or None if it stopped early,
    which is reported with the reason.
    """
    with opened(folder / places.JOURNAL, of) as journal:
        tasks = [task(cell, seed) for seed in seeds for cell in found]
        waiting = [one for one in tasks if not has_ended(journal, one)]
        stopped = None
        with watching(len(tasks), len(tasks) - len(waiting)) as watch:
            if waiting:
                with machines.workers(run) as workers:
                    stopped = work(journal, waiting, watch, workers)
        if not stopped:
            return dict(journal.entries)
        left = sum(not has_ended(journal, one) for one in tasks)
    sys.stderr.write(
        f"{stopped} with {left} of {len(tasks)} flights left; the same command with --out {folder} goes on\n"
    )
    return None
