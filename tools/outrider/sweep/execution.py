"""Execution of the tasks that have not been flown, by worker processes, with a journal."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from outrider.sweep.cells import Cell
from outrider.sweep.journal import Header, Journal
from outrider.sweep.progress import ResultCounter
from outrider.sweep.sources import versions
from outrider.sweep.tasks import AbandonedError, Ended, Entry, Task

WALL_LIMIT_S = 1800.0
"""Longest wall time of one run (s)."""


class Workers(Protocol):
    """Executor of tasks: a `Pool` of processes on this machine, or a `Cluster` of machines."""

    def work(self, tasks: Iterable[Task], ended: Ended, tick: Callable[[], None]) -> None:
        """Run all tasks.

        ``ended`` is called for each run that has ended, and for each loss of a run; ``tick`` is called about
        once a second or more often. Raises AbandonedError if the remaining tasks cannot be run.
        """


def work(journal: Journal, waiting: Sequence[Task], watch: ResultCounter, workers: Workers) -> str | None:
    """Run the waiting tasks; return None, or the reason if it stopped before the end.

    It stops early if the user pressed Ctrl-C or no workers are left.
    """

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
    """Return whether the task has ended. A lost run has not ended: it is tried again on resume."""
    entry = journal.entries.get(one.run)
    return entry is not None and entry.status != "lost"


def header(name: str, found: Sequence[Cell]) -> Header:
    """Return the journal's header.

    The cells identify the sweep: more runs of the same cells continue in the same journal.
    """
    of_cells = hashlib.sha256(" ".join(sorted(cell.key for cell in found)).encode()).hexdigest()
    return Header(name, of_cells, versions())
