"""Worker processes of a run, one per group of vehicles, forked after compiling what the vehicles need."""

from __future__ import annotations

from math import ceil
from pathlib import Path
from typing import Final

from mavlink_bridge.clocks.clock import PacedClock, WallClock
from mavlink_bridge.links.link import Link
from outrider.errors import OutriderError
from outrider.processes.children import Children
from outrider.processes.cores import cores
from outrider.sitl_server.request import Request
from outrider.sitl_server.shared_page import SharedPage
from outrider.sitl_server.worker import PERIOD, STRIDE, Worker
from sitl.autopilot.saved import Saved

FULL: Final = 10
"""Number of vehicles, multiplied by the speed if above 1, that one process runs before another is added."""
_STOP_TIMEOUT_S: Final = 5.0
"""Time limit for a process to end by itself (s)."""


def groups(count: int, speed: float, most: int) -> list[list[int]]:
    """Distribute the indices of ``count`` vehicles over up to ``most`` processes."""
    busy = ceil(count * max(speed, 1.0) / FULL)
    number = min(count, most, busy)
    return [list(range(group, count, number)) for group in range(number)]


class Processes:
    """Worker processes, one per group of vehicles; ``links`` by vehicle.

    After ``start`` the parent process has no link open.
    """

    def __init__(self, asked: Request, links: list[list[Link]], state: Path | None) -> None:
        self._asked, self._links = asked, links
        self.groups = groups(asked.count, asked.speed, cores())
        self.board = SharedPage(asked.count, len(self.groups))
        self._workers = [
            Worker(number, indices, asked, {str(index): links[index] for index in indices}, self.board, state)
            for number, indices in enumerate(self.groups)
        ]
        self._children = Children()

    def start(self) -> None:
        """Compile, then fork the processes."""
        first = self._asked.autopilot(0, 0, Saved())
        for now in (0, PERIOD):
            first.step(now, [])
        # One clock for all processes, so that wind and vehicles of all processes have the same time.
        clock = PacedClock(WallClock(), self._asked.speed, STRIDE, self.board)
        for number, worker in enumerate(self._workers):
            self._children.start(str(number), self._child, worker, clock)
        self._close(None)

    def check(self) -> None:
        """Raise OutriderError if a process has ended, with the reason that it wrote or its exit status."""
        for name, status in self._children.ended().items():
            number = int(name)
            fault = self.board.fault(number) or f"its process ended with status {status}"
            systems = ", ".join(str(self._asked.systems[index]) for index in self.groups[number])
            raise OutriderError(f"vehicles {systems}: {fault}")

    def stop(self) -> None:
        """Ask all processes to end, wait for them, and kill those that do not end in time."""
        self.board.stop = True
        self._children.join(_STOP_TIMEOUT_S)
        self._close(None)

    def _child(self, worker: Worker, clock: PacedClock) -> None:
        self._close(worker)
        worker.main(clock)

    def _close(self, spared: Worker | None) -> None:
        """Close all links except those of ``spared``."""
        for worker in self._workers:
            if worker is not spared:
                for links in worker.links.values():
                    for link in links:
                        link.close()
