"""Child processes by name: start by fork, exit status, stop and resume, join."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from multiprocessing.process import BaseProcess


class Children:
    """Child processes by name."""

    def __init__(self) -> None:
        self._processes: dict[str, BaseProcess] = {}

    def start(self, name: str, target: Callable[..., None], *arguments: object) -> None:
        """Fork a process that calls ``target`` with ``arguments``."""
        process = multiprocessing.get_context("fork").Process(target=target, args=arguments, name=name)
        self._processes[name] = process
        process.start()

    def ended(self) -> dict[str, int]:
        """Return the exit status of the processes that have ended, by name; negative for a signal."""
        found = {name: process.exitcode for name, process in self._processes.items()}
        return {name: status for name, status in found.items() if status is not None}

    def freeze(self, name: str) -> None:
        """Suspend a process with SIGSTOP."""
        self._signal(name, signal.SIGSTOP)

    def thaw(self, name: str) -> None:
        """Resume a suspended process."""
        self._signal(name, signal.SIGCONT)

    def join(self, within: float) -> None:
        """Resume all processes, wait for them, and kill those that do not end ``within`` seconds."""
        started = {name: process for name, process in self._processes.items() if process.pid is not None}
        for name in started:
            self.thaw(name)
        until = time.monotonic() + within
        for process in started.values():
            process.join(max(until - time.monotonic(), 0.1))
            if process.is_alive():
                process.kill()
                process.join()

    def _signal(self, name: str, which: signal.Signals) -> None:
        process = self._processes[name]
        if process.pid is not None and process.is_alive():
            os.kill(process.pid, which)
