"""Worker: body of the child process that runs the companion in real time, on its clock and links."""

from __future__ import annotations

import os
import signal
import sys
import time
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from companion.dry_run import DryRun
from companion.node import Companion
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.links.link import Link
from mavlink_bridge.loops.garbage import IdleCollector
from mavlink_bridge.loops.lockstep import Scheduled
from mavlink_bridge.loops.priority import ask_for_priority, sharpen_timers
from mavlink_bridge.loops.realtime import RealTime
from mavlink_bridge.wire.signing import Signing
from outrider.onboard.backup_copies import CopySender
from outrider.onboard.clocks import CompanionClock
from outrider.onboard.copied_node import CopiedNode
from outrider.onboard.log import Log
from outrider.onboard.process_channel import OrderLink
from outrider.onboard.read_only_link import ReadOnlyLink
from outrider.onboard.request import Request
from outrider.onboard.status import StatusReports
from outrider.onboard.transmit_statistics import TransmitStatistics
from outrider.supervision.duplicate_ids import DuplicateIds
from outrider.supervision.supervised_node import SupervisedNode

IGNORED: Final = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGTSTP,
    signal.SIGTTIN,
    signal.SIGTTOU,
)
"""Signals that a child ignores.

Only the parent handles them, so a closed or stopped terminal does not end the child.
"""


class Worker:
    """Body of the flying process.

    ``links`` maps the companion's link names to links, which ``duplicates`` observes; the log is written to
    ``directory``. ``simulated``: whether an earlier process identified the autopilot's clock as a
    simulation's; None if unknown. ``clock``: a new one by default. ``copies``: the end of the socket to the
    backup node; None without one.
    """

    def __init__(
        self,
        asked: Request,
        links: Mapping[str, Link],
        duplicates: DuplicateIds,
        orders: OrderLink,
        directory: Path,
        simulated: bool | None = None,
        clock: CompanionClock | None = None,
        copies: CopySender | None = None,
    ) -> None:
        self._clock = CompanionClock(asked.config.clock_error) if clock is None else clock
        self._copies = copies
        self._asked, self._orders, self._directory = asked, orders, directory
        self._read_only_links = [ReadOnlyLink(link) for link in links.values()] if asked.dry_run else []
        self._links = dict(zip(links, self._read_only_links or links.values(), strict=True))
        self._parent, self._duplicates, self._simulated = os.getpid(), duplicates, simulated
        self._signing = None if asked.key is None else Signing(asked.key)
        config, stopwatch, signing = asked.config, time.thread_time_ns, self._signing
        given = config.settings, config.system, config.target, config.origin.frame, stopwatch, signing
        self.companion: Companion = (
            DryRun(*given) if asked.dry_run else Companion(*given, self._clock.system_clock)
        )

    def resume(self, newest: int) -> None:
        """Sign with time stamps after ``newest``, the last one of an earlier process.

        They may be ahead of the wall clock if a simulation runs faster than it.
        """
        if self._signing is not None:
            self._signing.resume(newest)

    def followed(self, wall: Clock) -> FollowedClock | None:
        """Return the clock that the companion runs on; None if that is ``wall`` itself."""
        asked = self._asked.config.clock
        if asked == "wall":
            return None
        return FollowedClock(wall, wall.now(), simulated=True if asked == "autopilot" else self._simulated)

    def main(self) -> None:
        """Run the process from fork to exit; exit status 0, or 3 after an exception."""
        for which in IGNORED:
            signal.signal(which, signal.SIG_IGN)
        if self._asked.realtime:
            self._orders.tell(kind="event", at=0.0, what="priority", text=ask_for_priority().told)
        else:
            sharpen_timers()
        with Log(self._directory, self._asked.system, self._report_error) as log:
            status = self._flown(log)
            # The parent sends the hold request now; it need not wait until the files are written.
            self._orders.tell(kind="left")
        sys.exit(status)

    def _report_error(self, text: str) -> None:
        self._orders.tell(kind="event", at=None, what="concern", text=text)

    def _flown(self, log: Log) -> int:
        try:
            self._fly(log)
        except Exception as error:
            if os.environ.get("OUTRIDER_TRACEBACK"):
                traceback.print_exc()
            self._orders.tell(kind="fault", text=f"{type(error).__name__}: {error}")
            return 3
        return 0

    def _fly(self, log: Log) -> None:
        asked, node = self._asked, self.companion
        wall = self._clock.clock
        followed = self.followed(wall)
        supervised = SupervisedNode(node, wall, followed, self._signing, self._duplicates)
        departures = TransmitStatistics(node.config.limits, node.config.tracking.largest)
        news = StatusReports(supervised, departures, followed, self._signing, self._orders.tell)
        links: dict[str, Link | Sequence[Link]] = {
            **self._links,
            "ground": (self._links["ground"], self._orders),
        }

        certified = asked.config.certified
        clock = wall if followed is None else followed
        copied = None
        if self._copies is not None:
            copied = CopiedNode(
                supervised, node, self._copies, clock, self._signing, lambda: supervised.last is not None
            )
        reported = 0

        def stepped(now: int) -> bool:
            nonlocal reported
            alone = os.getppid() != self._parent or self._orders.alone
            if certified and (alone or self._orders.stop):
                supervised.finish()
            if alone and (not certified or supervised.rested):
                supervised.give_up()
            if isinstance(node, DryRun):
                for message in node.would:
                    departures.take(now, message)
                node.would.clear()
            news.look(now, wall.now())
            if copied is not None and copied.withheld > reported:
                reported = copied.withheld
                self._report_error("a step took so long that its set-points and its plan were not sent")
            if certified and self._orders.stop and supervised.rested:
                return True
            return supervised.last is not None and supervised.last.over

        with IdleCollector() as garbage:

            def idle(free: int) -> None:
                garbage.idle(free if followed is None else int(free / followed.rate))

            loop = RealTime(
                Scheduled(supervised if copied is None else copied, asked.config.period_us),
                links,
                clock,
                taps=(log, departures),
                on_idle=idle,
            )
            try:
                loop.run(lambda: self._orders.stop and not certified, stepped)
            finally:
                rate = 1.0 if followed is None else followed.rate
                self._leave(loop, news, departures, rate, 0 if copied is None else copied.withheld)

    def _leave(
        self,
        loop: RealTime,
        news: StatusReports,
        departures: TransmitStatistics,
        rate: float,
        withheld: int,
    ) -> None:
        """Send the figures of the summary to the parent."""
        node, statistics = self.companion, loop.statistics
        for reading in node.shed():
            news.plan_times.add(reading // 1000)
        profile = node.pilot.vehicle.profile
        mask = 0 if profile is None else profile.setpoint_mask
        self._orders.tell(
            kind="figures",
            plans=node.tally.plans,
            plan_ms={
                name: round(value * 1e-3, 3) for name, value in news.plan_times.spread._asdict().items()
            },
            solver_failures=node.tally.solver_failures,
            held_epochs=node.tally.held,
            anchored_anew=node.tally.anchored_anew,
            not_finite=node.not_finite,
            limits_lowered=list(node.pilot.limits.lowered.changes),
            limits_lacking=node.pilot.limits.lowered.lacking,
            limits_assumed=list(node.pilot.limits.unread),
            setpoints=departures.setpoints.facts,
            setpoint_faults=departures.setpoints.faults(mask),
            commands={str(command): count for command, count in sorted(departures.commands.items())},
            messages={
                "sent": dict(departures.messages),
                "received": {link: counters.good for link, counters in node.counters.items()},
                "bad": node.bad_frames,
                "refused": sum(counters.refused for counters in node.counters.values()),
                "overruns": statistics.overruns,
                "kept_back": sum(read_only.kept for read_only in self._read_only_links),
            },
            steps_withheld=withheld,
            deadline_steps=statistics.steps + statistics.skipped,
            deadline_misses=statistics.misses + statistics.skipped,
            lateness_ms={
                name: round(value * 1e-3 / rate, 3) for name, value in statistics.lateness._asdict().items()
            },
            clock_rate=round(rate, 4),
            cpu_s=round(time.process_time(), 2),
        )
