"""Flying what is not flown yet, in worker processes, into a journal."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

from outrider.sweeps.cells import Cell
from outrider.sweeps.journal import Header, Journal
from outrider.sweeps.pool import Pool
from outrider.sweeps.progress import Watch
from outrider.sweeps.sources import digest, sources
from outrider.sweeps.tasks import Entry, Task

_PACKAGES = ("outrider", "numpy", "scipy", "numba", "piqp", "filterpy", "pymavlink", "pymap3d")


def work(
    journal: Journal, waiting: Sequence[Task], watch: Watch, run: str, jobs: int, wall_limit_s: float
) -> bool:
    """Run what is waiting; True if somebody pressed Ctrl-C."""

    def ended(entry: Entry) -> None:
        journal.append(entry)
        watch.ended(entry)

    def tick() -> None:
        journal.settle()
        watch.tick()

    try:
        with Pool(run, jobs, wall_limit_s) as pool:
            pool.work(waiting, ended, tick)
    except KeyboardInterrupt:
        return True
    return False


def has_ended(journal: Journal, one: Task) -> bool:
    """A lost run has not ended: it is tried again on resume."""
    entry = journal.entries.get(one.run)
    return entry is not None and entry.status != "lost"


def header(name: str, found: Sequence[Cell]) -> Header:
    """The sweep is its cells: more runs of the same go on in the same journal."""
    of_cells = hashlib.sha256(" ".join(sorted(cell.key for cell in found)).encode()).hexdigest()
    versions = {"python": platform.python_version(), "machine": platform.machine()}
    versions["code"] = digest(sources())
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "none"
    return Header(name, of_cells, versions)


def cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
