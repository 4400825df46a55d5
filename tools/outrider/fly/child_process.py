"""The process that flies, as the one that looks after it has it."""

from __future__ import annotations

import multiprocessing
from multiprocessing.process import BaseProcess
from typing import Final

from outrider.fly.worker import Worker

FAREWELL: Final = 10.0
"""s that it has to leave its files."""
KILLED: Final = 1.0
"""s until one that was killed is waited for no longer: it is in the kernel, which waits for a disk, and flies
no more."""


class Crew:
    """Forks ``worker``."""

    def __init__(self, worker: Worker) -> None:
        fork = multiprocessing.get_context("fork")
        self._process: BaseProcess = fork.Process(target=worker.main, name="companion")
        self._killed = False

    def start(self) -> int:
        """Its process id."""
        self._process.start()
        return self._process.pid or 0

    @property
    def sentinel(self) -> int:
        """Readable: it has ended."""
        return self._process.sentinel

    @property
    def status(self) -> int | None:
        """Its exit status, negative for a signal; None while it runs."""
        return self._process.exitcode

    @property
    def killed(self) -> bool:
        """Whether it has been, and has nothing more to say."""
        return self._killed

    def kill(self) -> None:
        """At once."""
        self._killed = True
        self._process.kill()

    def join(self) -> None:
        """Wait until it has ended, by force if it takes too long."""
        if not self._killed:
            self._process.join(FAREWELL)
            if not self._process.is_alive():
                return
            self.kill()
        self._process.join(KILLED)
