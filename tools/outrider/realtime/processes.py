"""The processes of a real-time run: forked, watched, stopped and let go on, joined, and what they leave
behind."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import time
from collections.abc import Sequence
from multiprocessing.process import BaseProcess
from pathlib import Path

from outrider.realtime.shared_page import Board
from outrider.realtime.wiring import Wiring
from outrider.realtime.workers import Remains, Worker

_FAREWELL = 10.0
"""s that a process has to leave what it must."""


class Crew:
    """One process for each of ``workers``; each leaves its remains in ``scratch``."""

    def __init__(self, workers: Sequence[Worker], wiring: Wiring, board: Board, scratch: Path) -> None:
        self._workers, self._wiring, self._board, self._scratch = workers, wiring, board, scratch
        self._processes: dict[str, BaseProcess] = {}

    def start(self, *, priority: bool) -> None:
        """Fork all of them."""
        fork = multiprocessing.get_context("fork")
        for worker in self._workers:
            name = worker.rough.name
            arguments = (worker, self._wiring, self._scratch, priority)
            self._processes[name] = fork.Process(target=_child, args=arguments, name=name)
            self._processes[name].start()

    def ended(self) -> dict[str, int]:
        """Exit status of those that have ended, by name."""
        found = {name: process.exitcode for name, process in self._processes.items()}
        return {name: status for name, status in found.items() if status is not None}

    def freeze(self, name: str) -> None:
        """Stop a process."""
        self._signal(name, signal.SIGSTOP)

    def thaw(self, name: str) -> None:
        """Let a stopped process go on."""
        self._signal(name, signal.SIGCONT)

    def join(self) -> dict[str, Remains]:
        """Tell all to end, wait for them, and by force end who does not come; what they left, by name."""
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
    """What a process left; nothing if it was killed."""
    try:
        found = pickle.loads(path.read_bytes())
    except (OSError, EOFError, pickle.UnpicklingError):
        return Remains()
    return found if isinstance(found, Remains) else Remains()
