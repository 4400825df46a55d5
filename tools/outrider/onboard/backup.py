"""Parent's handle of the backup process, which it starts before the companion, and again when it is lost."""

from __future__ import annotations

import time
from collections.abc import Callable
from multiprocessing.connection import wait
from pathlib import Path
from typing import Final, NamedTuple

from mavlink_bridge.clocks.clock import Clock
from outrider.onboard.backup_copies import CopySender, copies_pair
from outrider.onboard.backup_worker import BackupWorker
from outrider.onboard.child_process import ChildProcess
from outrider.onboard.process_channel import Channel, OrderLink, intercom
from outrider.onboard.request import Request
from outrider.onboard.watchdog import Watchdog
from outrider.onboard.wiring import Wiring
from outrider.runs.names import BACKUP_LOGS

HUNG_S: Final = 5.0
"""Time without a report after which the backup process counts as hung (s)."""
_START_PERIOD_S: Final = 1.0
"""Least time between two starts of the process (s)."""
_END_TIMEOUT_S: Final = 12.0
"""Time limit for the end of a plan, its settling and the hold request (s)."""
_LOOK_S: Final = 0.05


class End(NamedTuple):
    """How the backup node ended: the result of the hold request, empty if it requested nothing."""

    said: str
    failed: bool
    carried: int


class Backup:
    """Backup process of one companion process.

    ``copies`` is the companion's end of the socket, for its process; ``tell`` receives events in words.
    ``newest`` returns the signing stamp after which a new process signs. The logs are written below
    ``directory``.
    """

    def __init__(
        self,
        asked: Request,
        wiring: Wiring,
        clock: Clock,
        newest: Callable[[], int],
        tell: Callable[[str, str], None],
        directory: Path,
    ) -> None:
        self._directory, self._number = directory, 0
        self._asked, self._wiring, self._clock = asked, wiring, clock
        self._newest, self._tell = newest, tell
        self.copies: CopySender
        self.copies, self._end = copies_pair()
        self._desk: Channel
        self._orders: OrderLink
        self._process: ChildProcess | None = None
        self._watchdog = Watchdog(time.monotonic())
        self._over: End | None = None
        self.carried = 0
        """Number of set-points that backup processes have sent, as last reported."""
        self._carried_before = 0
        self._next_start = 0.0

    def start(self) -> None:
        """Start the process."""
        self._number += 1
        self._desk, self._orders = intercom()
        worker = BackupWorker(
            self._asked,
            self._wiring,
            self._end,
            self._orders,
            self._clock,
            self._newest(),
            self.copies,
            self._directory / BACKUP_LOGS.format(self._number),
        )
        process = ChildProcess(worker)
        self._next_start = time.monotonic() + _START_PERIOD_S
        self._tell("process", f"the backup node runs in process {process.start()}")
        self._process = process
        self._orders.release()
        self._watchdog = Watchdog(time.monotonic(), HUNG_S)

    def release(self) -> None:
        """Close the companion's end of the socket in this process: the companion has started."""
        self.copies.close()

    def look(self) -> None:
        """Read its reports, and start it again if it is lost, at most once a second."""
        self._receive()
        hung = self._watchdog.stopped(time.monotonic())
        if self._process is not None and (hung or self._process.status is not None):
            self._tell("concern", "the backup node is lost: it hangs" if hung else "the backup node is lost")
            self._discard()
            self._carried_before = self.carried
        if self._process is None and time.monotonic() >= self._next_start:
            try:
                self.start()
            except OSError as error:
                self._tell("concern", f"the backup node cannot be started: {error}")

    def relieve(self, look: Callable[[], None]) -> End | None:
        """Let it fly the plan to its end and request the hold, as the companion is gone; ``look`` meanwhile.

        Returns the result; None if the process is lost, or has nothing to do.
        """
        until, process = time.monotonic() + _END_TIMEOUT_S, self._process
        if process is None:
            return None
        while self._over is None and process.status is None and time.monotonic() < until:
            self._desk.stop()
            wait([self._desk.fileno(), process.sentinel], _LOOK_S)
            self._receive()
            look()
        self._receive()
        over = self._over
        if over is None:
            # Nothing else may send to the autopilot beside the hold request that follows.
            self._discard()
        return over if over is not None and over.said else None

    def close(self) -> None:
        """End the process and close the socket."""
        self._discard()
        self.copies.close()
        self._end.close()

    def _discard(self) -> None:
        if self._process is None:
            return
        if self._process.status is None and self._over is None:
            self._process.kill()
        # One that is over still writes its log.
        self._process.join()
        self._receive()
        self._desk.close()
        self._process = None

    def _receive(self) -> None:
        for news in self._desk.news():
            self._watchdog.received(time.monotonic())
            kind = news.pop("kind")
            if kind in ("backup", "over"):
                self.carried = self._carried_before + news["carried"]
            if kind == "over":
                self._over = End(**news)
            elif kind == "fault":
                self._tell("concern", f"the backup node: {news['text']}")
