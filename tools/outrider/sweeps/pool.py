"""Runs tasks in local worker processes, each kept for many runs, so that a run costs no imports.

A worker that dies costs the one run it was at and is replaced. That run is tried once more at the end, when
all others have ended: what takes its worker down again stays lost. Which worker runs what, and when, depends
on the machine; results come from the task alone.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, NamedTuple

from outrider.errors import OutriderError
from outrider.sweeps.tasks import Entry, Task

MOST_STARTS = 5
"""Workers in a row that die before they are ready; then it is not bad luck."""
_TICK_S = 0.5
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""There are as many workers as cores; a library that starts threads of its own only slows them down."""
Ended = Callable[[Entry], None]


class Pool:
    """``jobs`` workers that call ``run``, a ``module:function``. Use it as a context: it leaves no process
    behind, whatever happens."""

    def __init__(self, run: str, jobs: int, wall_limit_s: float) -> None:
        self._run, self._jobs, self._limit = run, jobs, wall_limit_s
        self._selector = selectors.DefaultSelector()
        self._workers: list[_Worker] = []
        self._stillborn = 0

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self._selector.close()
        for worker in self._workers:
            worker.end()

    @property
    def workers(self) -> list[int]:
        """Process ids."""
        return [worker.process.pid for worker in self._workers]

    def work(self, tasks: Iterable[Task], ended: Ended, tick: Callable[[], None] = lambda: None) -> None:
        """Run all tasks. ``ended`` hears of each run that has ended, at once; of a lost one each time.
        ``tick`` is called at least every half second. OutriderError if no worker can be started."""
        waiting, again = deque(tasks), deque[Task]()
        tried: set[tuple[str, int]] = set()
        while waiting or again or any(worker.task for worker in self._workers):
            alive = len(self._workers)
            busy = sum(worker.task is not None for worker in self._workers)
            if not waiting and not busy:
                waiting, again = again, deque()
            for _ in range(min(self._jobs - alive, len(waiting) + busy - alive)):
                self._start()
            for key, _ in self._selector.select(self._next_limit()):
                self._hear(key.data)
            for worker in list(self._workers):
                entry = worker.take_entry() or self._buried(worker)
                if entry is not None:
                    task = worker.task
                    worker.task = None
                    if entry.status == "lost" and task is not None and task.run not in tried:
                        tried.add(task.run)
                        again.append(task)
                    ended(entry)
                if worker.ready and worker.task is None and not worker.dead and waiting:
                    worker.give(waiting.popleft())
            tick()

    def _start(self) -> None:
        worker = _Worker(self._run)
        self._workers.append(worker)
        self._selector.register(worker.output, selectors.EVENT_READ, worker)

    def _next_limit(self) -> float:
        now = time.monotonic()
        ends = [w.since + self._limit - now for w in self._workers if w.task is not None]
        return max(0.0, min([_TICK_S, *ends]))

    def _hear(self, worker: _Worker) -> None:
        worker.hear()
        if worker.cannot is not None:
            raise OutriderError(f"no worker can start: {worker.cannot}")
        if worker.ready:
            self._stillborn = 0

    def _buried(self, worker: _Worker) -> Entry | None:
        """If the worker is dead or too slow it is taken away; the entry of the run that it was at."""
        slow = worker.task is not None and time.monotonic() - worker.since >= self._limit
        if not worker.dead and not slow:
            return None
        self._selector.unregister(worker.output)
        self._workers.remove(worker)
        what = f"its worker {_death(worker.end())}"
        if not worker.dead:
            what = f"took longer than {self._limit:g} s of wall time"
        if not worker.ready:
            self._stillborn += 1
            if self._stillborn >= MOST_STARTS:
                raise OutriderError(f"no worker can start: {self._stillborn} in a row ended; {what}")
        if worker.task is None:
            return None
        return Entry(*worker.task.run, "lost", what, None, round(time.monotonic() - worker.since, 3))


class _Reply(NamedTuple):
    """The parts of a worker's line."""

    status: Any
    what: Any
    summary: Any
    wall_s: Any


class _Worker:
    """One process and the pipe to it. ``task`` is what it is at, ``since`` when (monotonic, s) it began."""

    def __init__(self, run: str) -> None:
        environment = {**os.environ, **_ONE_THREAD}
        # Tasks may be tests' own: the worker finds the modules that this process finds.
        environment["PYTHONPATH"] = os.pathsep.join(path or os.getcwd() for path in sys.path)
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "outrider.sweeps.worker", run],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            process_group=0,  # Ctrl-C is for the sweep: it ends the workers itself
        )
        if self.process.stdin is None or self.process.stdout is None:
            raise OutriderError("a worker has no pipes")
        self._input, self.output = self.process.stdin, self.process.stdout
        self._buffer = b""
        self._reply: _Reply | None = None
        self.task: Task | None = None
        self.since = 0.0
        self.ready = False
        self.dead = False
        self.cannot: str | None = None

    def give(self, task: Task) -> None:
        """Hand over the next task. If the worker has just died, that is seen when it is heard."""
        self.task, self.since = task, time.monotonic()
        with suppress(BrokenPipeError):
            self._input.write(json.dumps(task._asdict()).encode() + b"\n")
            self._input.flush()

    def hear(self) -> None:
        """Read what has come; called when there is something, and that may be the end."""
        data = os.read(self.output.fileno(), 1 << 20)
        self.dead = not data
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        for line in lines:
            said = json.loads(line)
            if "ready" in said:
                self.ready = True
            elif "cannot" in said:
                self.cannot = str(said["cannot"])
            else:
                self._reply = _Reply(**said)

    def take_entry(self) -> Entry | None:
        """How the run has ended that it was at; None if it has not."""
        if self._reply is None or self.task is None:
            return None
        reply, self._reply = self._reply, None
        return Entry(*self.task.run, reply.status, reply.what, reply.summary, reply.wall_s)

    def end(self) -> int:
        """Kill it if it still lives; its exit status."""
        self.process.kill()
        self.output.close()
        with suppress(BrokenPipeError):
            self._input.close()
        return self.process.wait()


def _death(status: int) -> str:
    if status >= 0:
        return f"ended with status {status}"
    try:
        return f"was killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"was killed by signal {-status}"
