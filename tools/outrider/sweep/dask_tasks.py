"""Functions that a Dask worker runs for a sweep; `Cluster` calls them there.

The Dask worker does not fly itself: it keeps a `Process` for each concurrent run, as a local pool does. A run
that ends its process, or is too slow, therefore costs only that process, and the Dask worker continues. When
the Dask worker dies, its processes end with it.
"""

from __future__ import annotations

import json
import select
from threading import Lock, Timer
from typing import Any
from uuid import uuid4

from outrider.sweep.pool import MOST_STARTS
from outrider.sweep.process import Process
from outrider.sweep.sources import version_of, versions
from outrider.sweep.tasks import Task

IDLE_S = 60.0
"""Time (s) after which an idle process ends: its sweep may have been killed."""
_TICK_S = 0.5
WORKER_ID = uuid4().hex
"""Identity of this worker process; it changes with a restart, even at the same address."""


class WorkerProcesses:
    """Processes of a Dask worker, by sweep."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._all: dict[str, set[Process]] = {}
        self._idle: dict[str, dict[Process, Timer]] = {}
        self._over: set[str] = set()

    def take(self, sweep: str, run: str) -> Process | None:
        """Return an idle process or a new one; None for a sweep that has ended."""
        with self._lock:
            if sweep in self._over:
                return None
            idle = self._idle.get(sweep, {})
            while idle:
                process, timer = idle.popitem()
                timer.cancel()
                if process.process.poll() is None:
                    return process
                self._end(sweep, process)
            process = Process(run)
            self._all.setdefault(sweep, set()).add(process)
            return process

    def give_back(self, sweep: str, process: Process) -> None:
        """Mark a process as idle after its run has ended."""
        timer = Timer(IDLE_S, self.dismiss, (sweep, process))
        timer.daemon = True
        with self._lock:
            self._idle.setdefault(sweep, {})[process] = timer
        timer.start()

    def forget(self, sweep: str, process: Process) -> None:
        """Remove a process that has ended."""
        with self._lock:
            self._all.get(sweep, set()).discard(process)

    def dismiss(self, sweep: str, only: Process | None = None) -> None:
        """End all processes of a sweep and start no more; or, with ``only``, that process if it is idle.

        A ``fly`` whose task one of the processes is running returns the entry of a lost run.
        """
        with self._lock:
            idle = self._idle.get(sweep, {})
            for process in [one for one in idle if only is None or one is only]:
                idle.pop(process).cancel()
                self._end(sweep, process)
            if only is None:
                self._over.add(sweep)
                self._idle.pop(sweep, None)
                for process in self._all.pop(sweep, set()):
                    process.process.kill()

    def _end(self, sweep: str, process: Process) -> None:
        process.end()
        self._all.get(sweep, set()).discard(process)


PROCESSES = WorkerProcesses()


def identify() -> dict[str, Any]:
    """Return the identity of this worker, and the versions that results depend on."""
    return {"me": WORKER_ID, "versions": required_versions()}


def required_versions() -> dict[str, str]:
    """Return the versions that must be the same on this worker and on the client."""
    return {**versions(), "distributed": version_of("distributed")}


def fly(worker_id: str, sweep: str, run: str, wall_limit_s: float, document: str) -> dict[str, Any]:
    """Fly one run in a process of this worker.

    ``document``: the ``Task`` as JSON; ``run``: the ``module:function`` that flies it; ``sweep``: id of the
    sweep; ``worker_id``: the expected ``WORKER_ID``; ``wall_limit_s``: longest wall time of the run (s).
    The result has one key: ``entry``, the ``Entry`` as a dict; or ``restarted`` if this is another worker; or
    ``unable``, the reason why no process can be started here.
    """
    if worker_id != WORKER_ID:
        return {"restarted": True}
    for _ in range(MOST_STARTS):
        process = PROCESSES.take(sweep, run)
        if process is None:
            return {"unable": "its sweep is over"}
        while not process.ready and not process.dead and process.cannot is None:
            process.receive()
        if process.ready and not process.dead:
            break
        what = process.cannot or process.terminate(wall_limit_s)
        process.end()
        PROCESSES.forget(sweep, process)
    else:
        return {"unable": what}
    task = Task(**json.loads(document))
    process.give(task)
    output = select.poll()
    output.register(process.output, select.POLLIN)
    while (entry := process.take_entry()) is None:
        if process.dead or process.overdue(wall_limit_s):
            PROCESSES.forget(sweep, process)
            return {"entry": process.lost(task, process.terminate(wall_limit_s))._asdict()}
        if output.poll(1e3 * min(_TICK_S, wall_limit_s)):
            process.receive()
    process.task = None
    PROCESSES.give_back(sweep, process)
    return {"entry": entry._asdict()}


def dismiss(sweep: str) -> None:
    """End the processes of a sweep that is over."""
    PROCESSES.dismiss(sweep)
