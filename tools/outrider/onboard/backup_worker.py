"""Backup worker: body of the process that runs the backup node, in real time."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from companion.backup_node import BackupNode
from companion.fleet_time_backup import FleetTimeBackup
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import Link, LinkCounters
from mavlink_bridge.loops.lockstep import Direction, Scheduled
from mavlink_bridge.loops.priority import ask_for_priority, sharpen_timers
from mavlink_bridge.loops.realtime import RealTime
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.signing import Signing
from outrider.onboard.backup_copies import CopyLink, CopySender, unpack
from outrider.onboard.backup_pilot import Backup, BackupPilot
from outrider.onboard.log import Log
from outrider.onboard.process_channel import OrderLink
from outrider.onboard.request import Request
from outrider.onboard.wiring import Wiring
from outrider.onboard.worker import IGNORED
from outrider.runs import names

KEPT: Final = ("autopilot", "swarm")
"""Links whose serial ports stay open in the parent and in the backup process.

A serial port cannot be opened a second time.
"""
_HUNG_US: Final = 6_000_000
"""Time without a copy after which a companion without a parent counts as gone (µs)."""
_REPORT_US: Final = 500_000
"""Time between two reports to the parent (µs)."""


class BackupWorker:
    """Body of the backup process of the companion that ``asked`` describes.

    ``wiring``: the open links, of which the autopilot's is used. ``copies``: what the companion copies.
    ``orders``: channel to the parent, whose stop request means that the companion is gone. ``clock``: the
    companion's. ``newest``: signing stamp after which it signs. ``sender``: the companion's end of the
    socket of ``copies``, which is closed in this process. What passes on the swarm link is logged in
    ``directory`` as well: the log of a companion that is killed lacks its last messages.
    """

    def __init__(
        self,
        asked: Request,
        wiring: Wiring,
        copies: CopyLink,
        orders: OrderLink,
        clock: Clock,
        newest: int,
        sender: CopySender,
        directory: Path,
    ) -> None:
        self._sender, self._directory = sender, directory
        self._asked, self._wiring, self._copies = asked, wiring, copies
        self._orders, self._clock, self._newest = orders, clock, newest
        self._parent = os.getpid()

    def main(self) -> None:
        """Run the process from fork to exit; exit status 0, or 3 after an exception."""
        for which in IGNORED:
            signal.signal(which, signal.SIG_IGN)
        if self._asked.realtime:
            ask_for_priority()
        else:
            sharpen_timers()
        try:
            with suppress(OSError):
                self._directory.mkdir(parents=True)
            with Log(self._directory, self._asked.system, self._report_error) as log:
                self._run(log)
        except Exception as error:
            if os.environ.get("OUTRIDER_TRACEBACK"):
                traceback.print_exc()
            self._orders.tell(kind="fault", text=f"{type(error).__name__}: {error}")
            sys.exit(3)
        sys.exit(0)

    def _report_error(self, text: str) -> None:
        self._orders.tell(kind="fault", text=text)

    def _run(self, log: Log) -> None:
        asked, orders = self._asked, self._orders
        signing = None if asked.key is None else Signing(asked.key)
        if signing is not None:
            signing.resume(self._newest)
        pilot = BackupPilot(asked.system, backup_of(asked, signing), signing, asked.key)
        # Otherwise the companion's end would never be seen to close.
        self._sender.close()
        self._wiring.lend(KEPT)
        self._wiring.take_over()
        next_report = 0

        def stepped(now: int) -> bool:
            nonlocal next_report
            # The companion flies no more if the parent says so, if its end of the socket is closed, or if it
            # hangs and no parent is left to end it.
            orphan = os.getppid() != self._parent
            hangs = orphan and pilot.silence(now) > _HUNG_US
            pilot.gone = pilot.gone or orders.stop or self._copies.ended or hangs
            self._wiring.release_unplugged()
            if now >= next_report:
                next_report = now + _REPORT_US
                orders.tell(kind="backup", carried=pilot.carried)
            if pilot.over and not orders.stop and not orphan:
                # The parent is told again when it asks.
                return False
            return pilot.over

        loop = RealTime(
            Scheduled(pilot, asked.config.period_us),
            {
                "copies": self._copies,
                "autopilot": _WhenDeaf(self._wiring.physical("autopilot"), lambda: pilot.deaf),
                "swarm": _WhenDeaf(self._wiring.physical("swarm"), lambda: pilot.gone),
                "orders": orders,
            },
            self._clock,
            taps=(_SwarmTap(log, asked.system),),
        )
        loop.run(lambda: False, stepped)
        held = pilot.held
        orders.tell(
            kind="over",
            carried=pilot.carried,
            said="" if held is None else held.said,
            failed=held is not None and held.failed,
        )


def backup_of(asked: Request, signing: Signing | None) -> Backup:
    """Return the backup node of the companion that ``asked`` describes; it signs with ``signing``."""
    config, system, frame = asked.config.settings, asked.system, asked.config.origin.frame
    if config.certified.fleet_time == "own":
        return BackupNode(config, system, frame, signing, finishes=True)
    return FleetTimeBackup(system, lambda: BackupNode(config, system, frame, signing, finishes=True), signing)


class _SwarmTap:
    """Observer that logs as the companion's what it receives and sends on the swarm link.

    What its backup node sends there is logged in the same way.
    """

    def __init__(self, log: Log, system: int) -> None:
        self._log, self._name = log, names.companion(system)

    def begin(self, now: int, node: str, /) -> None:
        """Do nothing: the times of steps are not needed."""

    def __call__(self, now: int, node: str, direction: Direction, datagrams: Sequence[Datagram], /) -> None:
        """Log the ``datagrams`` of the swarm link, and the copies that others hold."""
        for link, data in datagrams:
            if link == "copies":
                copies = unpack(data)
                # A backup process that was stopped reads old copies.
                self._add(copies.time, "in", copies.heard)
                self._add(copies.time, "out", copies.swarm)
            elif link == "swarm":
                self._add(now, direction, data)

    def _add(self, now: int, direction: Direction, data: bytes) -> None:
        if data:
            self._log(now, self._name, direction, [Datagram("swarm", data)])


class _WhenDeaf:
    """``Link`` that is read only while the companion is ``deaf``, which does not read it then."""

    def __init__(self, link: Link, deaf: Callable[[], bool]) -> None:
        self._link, self._deaf = link, deaf

    @property
    def counters(self) -> LinkCounters:
        """Counters of the physical link."""
        return self._link.counters

    def fileno(self) -> None:
        """Return None: the link is read in each step."""

    def receive(self) -> list[bytes]:
        """Return what has arrived, if the companion is deaf."""
        return self._link.receive() if self._deaf() else []

    def send(self, data: bytes) -> None:
        """Send ``data``."""
        self._link.send(data)

    def close(self) -> None:
        """Close the physical link in this process."""
        self._link.close()
