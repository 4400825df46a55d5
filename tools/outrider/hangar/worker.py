"""The process of a squad: its vehicles under the wall clock over their links, until all shall end."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from mavlink_bridge.clock import PacedClock, WallClock
from mavlink_bridge.garbage import IdleCollector
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.streams import StreamLink
from mavlink_bridge.links.udp import UdpListener
from mavlink_bridge.priority import sharpen_timers
from mavlink_bridge.realtime import RealTime
from mavlink_bridge.runtime import Scheduled
from outrider.hangar.board import Board, Pace
from outrider.hangar.cabinet import Cabinet
from outrider.hangar.request import Request
from outrider.hangar.squad import Squad
from sitl.node import Autopilot

PERIOD: Final = 10_000
"""µs (simulated) between two steps."""
STRIDE: Final = 250_000
"""µs (simulated) that are made up for at once when the machine was busy; what is more is lost."""
_SHOWN: Final = 1.0
# s between two looks at how the loop keeps up.


class Worker:
    """``indices``: its vehicles; ``links`` of each by its index; ``squad``: its row on the ``board``."""

    def __init__(
        self,
        squad: int,
        indices: Sequence[int],
        asked: Request,
        links: dict[str, list[Link]],
        board: Board,
        state: Path | None,
    ) -> None:
        self.links = links
        self._number, self._indices, self._asked, self._board = squad, indices, asked, board
        self._state = state
        self._parent = os.getpid()

    def main(self) -> None:
        """The process, from fork to exit. The parent alone is told by signals when to end, and tells it."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        sharpen_timers()
        try:
            self._run()
        except Exception as error:
            self._board.fail(self._number, f"{type(error).__name__}: {error}")
            sys.exit(3)
        sys.exit(0)

    def _over(self) -> bool:
        return self._board.stop or os.getppid() != self._parent

    def _run(self) -> None:
        asked, wall = self._asked, WallClock()
        cabinet = Cabinet(self._state, asked.flavour)
        vehicles = {
            index: Autopilot(
                asked.config(index, wall.now()),
                asked.vehicle,
                asked.frame,
                asked.seed,
                saved=cabinet.saved(asked.systems[index]),
            )
            for index in self._indices
        }
        squad = Squad(vehicles, asked.first_id, self._board, asked.speed)
        with IdleCollector() as garbage:
            clock = PacedClock(wall, asked.speed, STRIDE)
            loop = RealTime(
                Scheduled(squad, PERIOD),
                self.links,
                clock,
                on_idle=lambda left: garbage.idle(int(left / asked.speed)),
            )
            began, looked = time.monotonic(), 0.0

            def look(now: int) -> None:
                nonlocal looked
                squad.show(now, self._clients)
                elapsed = time.monotonic() - began
                if elapsed - looked >= _SHOWN:
                    looked = elapsed
                    self._board.show_pace(self._number, _pace(loop, now, elapsed))
                    cabinet.keep(squad)

            try:
                loop.run(self._over, look)
            finally:
                cabinet.keep(squad)
                self._board.show_pace(self._number, _pace(loop, clock.now(), time.monotonic() - began))

    def _clients(self, link: str) -> int:
        return sum(one.peers for one in self.links[link] if isinstance(one, StreamLink | UdpListener))


def _pace(loop: RealTime, now: int, wall: float) -> Pace:
    """How ``loop`` keeps up, ``now`` (µs) being ``wall`` seconds after it began."""
    due, statistics = loop.deadlines, loop.statistics
    lateness = statistics.lateness
    return Pace(
        now * 1e-6,
        wall,
        statistics.steps,
        due.misses,
        due.skipped,
        lateness.p99 * 1e-3,
        lateness.max * 1e-3,
        statistics.overruns,
    )
