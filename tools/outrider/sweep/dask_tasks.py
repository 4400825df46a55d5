"""What a Dask worker does for a sweep, whose `Cluster` calls these functions there.

It flies nothing itself: for each run that it has at a time it keeps a `Process`, as a local pool does. So a
run that takes its process down, or is too slow, costs that process, and the Dask worker goes on; and when the
Dask worker dies its processes end with it.
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
"""A process without a run ends after so long: its sweep has been killed."""
_TICK_S = 0.5
ME = uuid4().hex
"""Another one after a restart, at the same address too."""


class Crew:
    """The processes of a Dask worker, by the sweep that they fly for."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._all: dict[str, set[Process]] = {}
        self._idle: dict[str, dict[Process, Timer]] = {}
        self._over: set[str] = set()

    def take(self, sweep: str, run: str) -> Process | None:
        """One that is ready, or a new one; none for a sweep that is over."""
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
        """Its run has ended."""
        timer = Timer(IDLE_S, self.dismiss, (sweep, process))
        timer.daemon = True
        with self._lock:
            self._idle.setdefault(sweep, {})[process] = timer
        timer.start()

    def forget(self, sweep: str, process: Process) -> None:
        """It has ended."""
        with self._lock:
            self._all.get(sweep, set()).discard(process)

    def dismiss(self, sweep: str, only: Process | None = None) -> None:
        """End those of a sweep, or only one of them if it is idle. Whoever waits for one sees it die."""
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


CREW = Crew()


def introduce() -> dict[str, Any]:
    """Who this is, and all that results depend on here."""
    return {"me": ME, "versions": equipment()}


def equipment() -> dict[str, str]:
    """The versions that must be the same here and where the sweep was begun."""
    return {**versions(), "distributed": version_of("distributed")}


def fly(me: str, sweep: str, run: str, wall_limit_s: float, document: str) -> dict[str, Any]:
    """Fly a task, in JSON, for a ``sweep`` by ``run``, a ``module:function``: its ``entry``. Or
    ``restarted``: this is not the worker ``me`` that was meant; or ``unable``: why no process can be started
    here."""
    if me != ME:
        return {"restarted": True}
    for _ in range(MOST_STARTS):
        process = CREW.take(sweep, run)
        if process is None:
            return {"unable": "its sweep is over"}
        while not process.ready and not process.dead and process.cannot is None:
            process.receive()
        if process.ready and not process.dead:
            break
        what = process.cannot or process.bury(wall_limit_s)
        process.end()
        CREW.forget(sweep, process)
    else:
        return {"unable": what}
    task = Task(**json.loads(document))
    process.give(task)
    output = select.poll()
    output.register(process.output, select.POLLIN)
    while (entry := process.take_entry()) is None:
        if process.dead or process.overdue(wall_limit_s):
            CREW.forget(sweep, process)
            return {"entry": process.lost(task, process.bury(wall_limit_s))._asdict()}
        if output.poll(1e3 * min(_TICK_S, wall_limit_s)):
            process.receive()
    process.task = None
    CREW.give_back(sweep, process)
    return {"entry": entry._asdict()}


def dismiss(sweep: str) -> None:
    """The sweep is over: end its processes."""
    CREW.dismiss(sweep)
