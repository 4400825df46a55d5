"""Worker process of a group of vehicles, under the wall clock and over their links."""

from __future__ import annotations

import os
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from mavlink_bridge.clocks.clock import PacedClock, WallClock
from mavlink_bridge.links.link import Link
from mavlink_bridge.loops.garbage import IdleCollector
from mavlink_bridge.loops.lockstep import Scheduled
from mavlink_bridge.loops.priority import sharpen_timers
from mavlink_bridge.loops.realtime import RealTime
from outrider.sitl_server.clients import Clients
from outrider.sitl_server.persistence import Persistence
from outrider.sitl_server.request import Request
from outrider.sitl_server.shared_page import Pace, SharedPage
from outrider.sitl_server.vehicle_group import VehicleGroup, boot_times

PERIOD: Final = 10_000
"""Simulated time between two steps (µs), from real time up to 10 times as fast."""
_MAX_SPEED_AT_PERIOD, _MAX_PERIOD_FACTOR = 10.0, 5.0
# Largest speed with steps of PERIOD, and largest multiple of PERIOD at higher speeds; see ``period``.
_PHYSICS_STEP_US: Final = 2500
STRIDE: Final = 250_000
"""Largest simulated time (µs) between two waits; if the machine was busy for longer, the rest is lost."""
_PACE_PERIOD_S: Final = 1.0
# Time between two records of the loop's timing.


class Worker:
    """Worker of one group: its row ``group`` of the board, its vehicles ``indices``, ``links`` by index."""

    def __init__(
        self,
        group: int,
        indices: Sequence[int],
        asked: Request,
        links: dict[str, list[Link]],
        board: SharedPage,
        state: Path | None,
    ) -> None:
        self.links = links
        self._number, self._indices, self._asked, self._board = group, indices, asked, board
        self._state = state
        self._parent = os.getpid()

    def main(self, clock: PacedClock) -> None:
        """Run the process, from fork to exit, under ``clock``.

        Signals to end are handled by the parent alone, which sets the board's ``stop``.
        """
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        sharpen_timers()
        try:
            self._run(clock)
        except Exception as error:
            if os.environ.get("OUTRIDER_TRACEBACK"):
                traceback.print_exc()
            self._board.fail(self._number, f"{type(error).__name__}: {error}")
            sys.exit(3)
        sys.exit(0)

    def _over(self) -> bool:
        return self._board.stop or os.getppid() != self._parent

    def _run(self, clock: PacedClock) -> None:
        asked, wall = self._asked, WallClock()
        persistence = Persistence(self._state, asked.flavour)
        boots = boot_times(self._indices, asked.speed, period(asked.speed))
        vehicles = {
            index: asked.autopilot(index, clock.start + boot, persistence.saved(asked.systems[index]))
            for index, boot in boots.items()
        }
        clients = Clients(self.links, wall)
        group = VehicleGroup(vehicles, boots, asked.first_id, self._board, asked.speed, asked.target())
        with IdleCollector() as garbage:
            loop = RealTime(
                Scheduled(group, period(asked.speed)),
                self.links,
                clock,
                tolerance=round(PERIOD * max(asked.speed, 1.0)),
                on_idle=lambda left: garbage.idle(int(left / asked.speed)),
            )
            began, looked = time.monotonic(), 0.0

            def look(now: int) -> None:
                nonlocal looked
                group.show(now, clients)
                elapsed = time.monotonic() - began
                if elapsed - looked >= _PACE_PERIOD_S:
                    looked = elapsed
                    self._board.show_pace(self._number, _pace(loop, now, elapsed))
                    persistence.keep(group)

            try:
                loop.run(self._over, look)
            finally:
                persistence.keep(group, ending=True)
                self._board.show_pace(self._number, _pace(loop, clock.now(), time.monotonic() - began))


def period(speed: float) -> int:
    """Return the simulated time between two steps (µs) when time is ``speed`` times as fast.

    It is a multiple of 2.5 ms: 10 ms of wall time up to real time, but at least 2.5 ms simulated; 10 ms
    simulated up to 10 times as fast; above, 1 ms of wall time, but at most 50 ms simulated, so that telemetry
    at 20 Hz remains possible.
    """
    of_usual = speed if speed < 1.0 else min(max(speed / _MAX_SPEED_AT_PERIOD, 1.0), _MAX_PERIOD_FACTOR)
    return max(int(PERIOD * of_usual) // _PHYSICS_STEP_US, 1) * _PHYSICS_STEP_US


def _pace(loop: RealTime, now: int, wall: float) -> Pace:
    """Return the timing of ``loop`` at ``now`` (µs), ``wall`` seconds after it began."""
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
