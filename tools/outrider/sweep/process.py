"""A process that flies runs one after the other, as `worker` says, and the pipe to it. Whoever has it may end
it in the middle of a run: that costs the one run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from typing import Any, NamedTuple

from outrider.errors import OutriderError
from outrider.sweep.tasks import Entry, Task

_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""There are as many workers as cores; a library that starts threads of its own only slows them down."""


class _Reply(NamedTuple):
    """The parts of a worker's line."""

    status: Any
    what: Any
    summary: Any
    wall_s: Any


class Process:
    """One process and the pipe to it. ``task`` is what it is at, ``since`` when (monotonic, s) it began."""

    def __init__(self, run: str) -> None:
        environment = {**os.environ, **_ONE_THREAD}
        # Tasks may be tests' own: the worker finds the modules that this process finds.
        environment["PYTHONPATH"] = os.pathsep.join(path or os.getcwd() for path in sys.path)
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "outrider.sweep.worker", run],
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

    def receive(self) -> None:
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

    def overdue(self, limit_s: float) -> bool:
        """Whether its run has taken longer than it may."""
        return self.task is not None and time.monotonic() - self.since >= limit_s

    def bury(self, limit_s: float) -> str:
        """End it because it is dead, or slower than ``limit_s``; which of both, as what became of its run."""
        dead, status = self.dead, self.end()
        return f"its worker {death(status)}" if dead else f"took longer than {limit_s:g} s of wall time"

    def lost(self, task: Task, what: str) -> Entry:
        """The entry of the ``task`` that it was at."""
        return Entry(*task.run, "lost", what, None, round(time.monotonic() - self.since, 3))

    def end(self) -> int:
        """Kill it if it still lives; its exit status. It is dead from then on, and gets no task any more."""
        self.dead = True
        self.process.kill()
        self.output.close()
        with suppress(BrokenPipeError):
            self._input.close()
        return self.process.wait()


def death(status: int) -> str:
    """How a process with this exit status ended, in words."""
    if status >= 0:
        return f"ended with status {status}"
    try:
        return f"was killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"was killed by signal {-status}"
