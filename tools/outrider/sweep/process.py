"""Process that flies runs one after the other, see `worker`, and the pipe to it.

It may be ended in the middle of a run; only that run is lost.
"""

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
"""Variables that limit libraries to one thread.

By default there are as many workers as cores, and more threads would slow them down.
"""


class _Reply(NamedTuple):
    """Fields of a worker's result line."""

    status: Any
    what: Any
    summary: Any
    wall_s: Any


class Process:
    """Worker process and the pipe to it.

    ``task`` is its current task, ``since`` the time at which it received that task (monotonic, s). ``ready``:
    it has imported its function; ``cannot``: the reason why it could not; ``dead``: its output has ended, or
    it was killed.
    """

    def __init__(self, run: str) -> None:
        environment = {**os.environ, **_ONE_THREAD}
        # Tasks may use functions of tests: the worker finds the same modules as this process.
        environment["PYTHONPATH"] = os.pathsep.join(path or os.getcwd() for path in sys.path)
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "outrider.sweep.worker", run],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            process_group=0,  # Ctrl-C reaches only the sweep, which ends the workers itself
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
        """Send the next task. If the worker has just died, the next `receive` finds that."""
        self.task, self.since = task, time.monotonic()
        with suppress(BrokenPipeError):
            self._input.write(json.dumps(task._asdict()).encode() + b"\n")
            self._input.flush()

    def receive(self) -> None:
        """Read available output, or wait for some; at the end of the output ``dead`` becomes true."""
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
        """Return the entry of the run if it has ended, otherwise None."""
        if self._reply is None or self.task is None:
            return None
        reply, self._reply = self._reply, None
        return Entry(*self.task.run, reply.status, reply.what, reply.summary, reply.wall_s)

    def overdue(self, limit_s: float) -> bool:
        """Return whether the run has taken longer than ``limit_s`` (s)."""
        return self.task is not None and time.monotonic() - self.since >= limit_s

    def terminate(self, limit_s: float) -> str:
        """End the process and return why: it is dead, or slower than ``limit_s``."""
        dead, status = self.dead, self.end()
        return f"its worker {death(status)}" if dead else f"took longer than {limit_s:g} s of wall time"

    def lost(self, task: Task, what: str) -> Entry:
        """Return the entry of the lost ``task``."""
        return Entry(*task.run, "lost", what, None, round(time.monotonic() - self.since, 3))

    def end(self) -> int:
        """Kill the process if it is alive, and return its exit status. It gets no task afterwards."""
        self.dead = True
        self.process.kill()
        self.output.close()
        with suppress(BrokenPipeError):
            self._input.close()
        return self.process.wait()


def death(status: int) -> str:
    """Describe in words how a process with this exit status ended."""
    if status >= 0:
        return f"ended with status {status}"
    try:
        return f"was killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"was killed by signal {-status}"
