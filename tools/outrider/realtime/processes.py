"""Processes of a real-time run, and their results."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from pathlib import Path

from outrider.processes.children import Children
from outrider.realtime.shared_page import SharedPage
from outrider.realtime.wiring import Wiring
from outrider.realtime.workers import ProcessResults, Worker

_EXIT_TIMEOUT_S = 10.0
"""Time limit (s) for the processes to write their results and end."""


class Processes(Children):
    """One process for each of ``workers``; each writes its results to ``scratch``."""

    def __init__(self, workers: Sequence[Worker], wiring: Wiring, board: SharedPage, scratch: Path) -> None:
        super().__init__()
        self._workers, self._wiring, self._board, self._scratch = workers, wiring, board, scratch

    def start_all(self, *, priority: bool) -> None:
        """Fork all processes."""
        for worker in self._workers:
            self.start(worker.rough.name, _child, worker, self._wiring, self._scratch, priority)

    def results(self) -> dict[str, ProcessResults]:
        """End all processes, kill those that do not end in time, and return their results by name."""
        self._board.stop = True
        self.join(_EXIT_TIMEOUT_S)
        names = [worker.rough.name for worker in self._workers]
        return {name: _remains(self._scratch / name) for name in names}


def _child(worker: Worker, wiring: Wiring, scratch: Path, priority: bool) -> None:
    wiring.close_others(worker.links)
    worker.main(scratch, priority)


def _remains(path: Path) -> ProcessResults:
    """Return the results of a process; empty ones if it was killed."""
    try:
        found = pickle.loads(path.read_bytes())
    except (OSError, EOFError, pickle.UnpicklingError):
        return ProcessResults()
    return found if isinstance(found, ProcessResults) else ProcessResults()
