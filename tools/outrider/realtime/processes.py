"""Processes of a real-time run: they are forked, observed, stopped and resumed, joined, and leave results."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import time
from collections.abc import Sequence
from multiprocessing.process import BaseProcess
from pathlib import Path

from outrider.realtime.shared_page import SharedPage
from outrider.realtime.wiring import Wiring
from outrider.realtime.workers import Remains, Worker

_FAREWELL = 10.0
"""s that a process has to write its results."""


class Processes:
    """One process for each of ``workers``; each writes its results to ``scratch``."""

    def __init__(self, workers: Sequence[Worker], wiring: Wiring, board: SharedPage, scratch: Path) -> None:
        self._workers, self._wiring, self._board, self._scratch = workers, wiring, board, scratch
        self._processes: dict[str, BaseProcess] = {}

    def start(self, *, priority: bool) -> None:
        """Fork all processes."""
        fork = multiprocessing.get_context("fork")
        for worker in self._workers:
            name = worker.rough.name
            arguments = (worker, self._wiring, self._scratch, priority)
            self._processes[name] = fork.Process(target=_child, args=arguments, name=name)
            self._processes[name].start()

    def ended(self) -> dict[str, int]:
        """Return the exit status of the processes that have ended, by name."""
        found = {name: process.exitcode for name, process in self._processes.items()}
        return {name: status for name, status in found.items() if status is not None}

    def freeze(self, name: str) -> None:
        """Stop a process."""
        self._signal(name, signal.SIGSTOP)

    def thaw(self, name: str) -> None:
        """Resume a stopped process."""
        self._signal(name, signal.SIGCONT)

    def join(self) -> dict[str, Remains]:
        """End all processes, kill those that do not end in time, and return their results by name."""
        self._board.stop = True
        for name in self._processes:
            self.thaw(name)
        until = time.monotonic() + _FAREWELL
        for process in self._processes.values():
            process.join(max(until - time.monotonic(), 0.1))
            if process.is_alive():
                process.kill()
                process.join()
        return {name: _remains(self._scratch / name) for name in self._processes}

    def _signal(self, name: str, which: signal.Signals) -> None:
        process = self._processes[name]
        if process.pid is not None and process.is_alive():
            os.kill(process.pid, which)


def _child(worker: Worker, wiring: Wiring, scratch: Path, priority: bool) -> None:
    wiring.close_others(worker.links)
    worker.main(scratch, priority)


def _remains(path: Path) -> Remains:
    """Return the results of a process; empty ones if it was killed."""
    try:
        found = pickle.loads(path.read_bytes())
    except (OSError, EOFError, pickle.UnpicklingError):
        return Remains()
    return found if isinstance(found, Remains) else Remains()
