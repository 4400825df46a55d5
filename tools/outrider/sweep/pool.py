"""Local worker processes, each used for many runs, so that a run does not repeat the imports.

A worker that dies costs only its current run and is replaced. That run is tried once more after all others
have ended; a run that ends its worker again stays lost. Which worker runs which task, and when, depends on
the machine; the results depend on the task alone.
"""

from __future__ import annotations

import selectors
import time
from collections.abc import Callable, Iterable

from outrider.errors import OutriderError
from outrider.sweep.backlog import Backlog
from outrider.sweep.process import Process
from outrider.sweep.tasks import Ended, Entry, Task

MOST_STARTS = 5
"""Number of workers in a row that die before they are ready, after which no more are started."""
_TICK_S = 0.5


class Pool:
    """Pool of ``jobs`` workers that call ``run``, a ``module:function``.

    It is a context manager that ends all its workers on exit.
    """

    def __init__(self, run: str, jobs: int, wall_limit_s: float) -> None:
        self._run, self._jobs, self._limit = run, jobs, wall_limit_s
        self._selector = selectors.DefaultSelector()
        self._workers: list[Process] = []
        self._failed_starts = 0

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self._selector.close()
        for worker in self._workers:
            worker.end()

    @property
    def workers(self) -> list[int]:
        """Process ids of the workers."""
        return [worker.process.pid for worker in self._workers]

    def work(self, tasks: Iterable[Task], ended: Ended, tick: Callable[[], None] = lambda: None) -> None:
        """Run all tasks.

        ``ended`` is called for each run that has ended, and for each loss of a run. ``tick`` is called
        at least every half second. Raises OutriderError if no worker can be started.
        """
        backlog = Backlog(tasks)
        while backlog.goes_on(busy := sum(worker.task is not None for worker in self._workers)):
            alive = len(self._workers)
            for _ in range(min(self._jobs - alive, len(backlog) + busy - alive)):
                self._start()
            for key, _ in self._selector.select(self._next_limit()):
                self._receive(key.data)
            for worker in list(self._workers):
                entry = worker.take_entry() or self._removed(worker)
                if entry is not None:
                    task, worker.task = worker.task, None
                    if entry.status == "lost" and task is not None:
                        backlog.lost(task)
                    ended(entry)
                if worker.ready and worker.task is None and not worker.dead and backlog:
                    worker.give(backlog.take())
            tick()

    def _start(self) -> None:
        worker = Process(self._run)
        self._workers.append(worker)
        self._selector.register(worker.output, selectors.EVENT_READ, worker)

    def _next_limit(self) -> float:
        now = time.monotonic()
        ends = [w.since + self._limit - now for w in self._workers if w.task is not None]
        return max(0.0, min([_TICK_S, *ends]))

    def _receive(self, worker: Process) -> None:
        worker.receive()
        if worker.cannot is not None:
            raise OutriderError(f"no worker can start: {worker.cannot}")
        if worker.ready:
            self._failed_starts = 0

    def _removed(self, worker: Process) -> Entry | None:
        """Remove the worker if it is dead or too slow, and return the entry of its run, if it had one."""
        if not worker.dead and not worker.overdue(self._limit):
            return None
        self._selector.unregister(worker.output)
        self._workers.remove(worker)
        what = worker.terminate(self._limit)
        if not worker.ready:
            self._failed_starts += 1
            if self._failed_starts >= MOST_STARTS:
                raise OutriderError(f"no worker can start: {self._failed_starts} in a row ended; {what}")
        return None if worker.task is None else worker.lost(worker.task, what)
