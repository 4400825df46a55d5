"""Parent's handle of a child process, which runs the companion or its backup node."""

from __future__ import annotations

import gc
import multiprocessing
from multiprocessing.process import BaseProcess
from typing import Final, Protocol

EXIT_TIMEOUT_S: Final = 10.0
"""Time limit for the child to write its files and end (s)."""
KILL_TIMEOUT_S: Final = 1.0
"""Time limit for a killed child to end (s).

A process that still exists then is probably blocked in the kernel by a disk; it executes no more code.
"""


class Body(Protocol):
    """What a child process does from fork to exit."""

    def main(self) -> None:
        """Run the process."""
        ...


class ChildProcess:
    """Child process that runs ``worker.main``, started by fork."""

    def __init__(self, worker: Body) -> None:
        fork = multiprocessing.get_context("fork")
        self._process: BaseProcess = fork.Process(target=worker.main, name="companion")
        self._killed = False

    def start(self) -> int:
        """Start the process and return its process id.

        All objects are frozen before: a garbage collection in either process would write to the pages of
        each of them, which both processes share.
        """
        gc.collect()
        gc.freeze()
        self._process.start()
        return self._process.pid or 0

    @property
    def sentinel(self) -> int:
        """File descriptor that becomes readable when the process has ended."""
        return self._process.sentinel

    @property
    def status(self) -> int | None:
        """Exit status, negative for a signal; None while the process runs."""
        return self._process.exitcode

    @property
    def killed(self) -> bool:
        """Whether ``kill`` was called; the process may not have ended yet."""
        return self._killed

    def kill(self) -> None:
        """Send SIGKILL to the process, without waiting for its end."""
        self._killed = True
        self._process.kill()

    def join(self) -> None:
        """Wait until the process has ended; kill it if it takes longer than ``EXIT_TIMEOUT_S``.

        After ``kill``, here or earlier, wait at most ``KILL_TIMEOUT_S``; return even if the process has not
        ended.
        """
        if not self._killed:
            self._process.join(EXIT_TIMEOUT_S)
            if not self._process.is_alive():
                return
            self.kill()
        self._process.join(KILL_TIMEOUT_S)
