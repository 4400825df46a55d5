"""Child process that flies, as seen by its parent."""

from __future__ import annotations

import multiprocessing
from multiprocessing.process import BaseProcess
from typing import Final

from outrider.fly.worker import Worker

FAREWELL: Final = 10.0
"""Time limit for the child to write its files (s)."""
KILLED: Final = 1.0
"""Time limit for a killed child to end (s).

After that it is blocked in the kernel, waiting for a disk, and no longer flies.
"""


class ChildProcess:
    """Child process that runs ``worker.main``, started by fork."""

    def __init__(self, worker: Worker) -> None:
        fork = multiprocessing.get_context("fork")
        self._process: BaseProcess = fork.Process(target=worker.main, name="companion")
        self._killed = False

    def start(self) -> int:
        """Start the process and return its process id."""
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
        """Whether the process has been killed, and so sends nothing more."""
        return self._killed

    def kill(self) -> None:
        """Kill the process immediately."""
        self._killed = True
        self._process.kill()

    def join(self) -> None:
        """Wait until the process has ended; kill it if it takes longer than ``FAREWELL``."""
        if not self._killed:
            self._process.join(FAREWELL)
            if not self._process.is_alive():
                return
            self.kill()
        self._process.join(KILLED)
