"""Flying what is not flown yet, in worker processes, into a journal."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from outrider.sweep.cells import Cell
from outrider.sweep.journal import Header, Journal
from outrider.sweep.progress import Watch
from outrider.sweep.sources import versions
from outrider.sweep.tasks import AbandonedError, Ended, Entry, Task

WALL_LIMIT_S = 1800.0
"""s of wall time for one run."""


class Workers(Protocol):
    """Who runs tasks: a `Pool` of processes here, or a `Cluster` of machines."""

    def work(self, tasks: Iterable[Task], ended: Ended, tick: Callable[[], None]) -> None:
        """Run all tasks. ``ended`` hears of each run that has ended, of a lost one each time; ``tick`` is
        called at least every second or so. AbandonedError if the rest cannot be run."""


def work(journal: Journal, waiting: Sequence[Task], watch: Watch, workers: Workers) -> str | None:
    """Run what is waiting; why it was stopped before the end, if it was: somebody pressed Ctrl-C, or there is
    nobody left to run it."""

    def ended(entry: Entry) -> None:
        journal.append(entry)
        watch.ended(entry)

    def tick() -> None:
        journal.settle()
        watch.tick()

    try:
        workers.work(waiting, ended, tick)
    except KeyboardInterrupt:
        return "stopped"
    except AbandonedError as error:
        return f"{error}; stopped"
    return None


def has_ended(journal: Journal, one: Task) -> bool:
    """A lost run has not ended: it is tried again on resume."""
    entry = journal.entries.get(one.run)
    return entry is not None and entry.status != "lost"


def header(name: str, found: Sequence[Cell]) -> Header:
    """The sweep is its cells: more runs of the same go on in the same journal."""
    of_cells = hashlib.sha256(" ".join(sorted(cell.key for cell in found)).encode()).hexdigest()
    return Header(name, of_cells, versions())
