"""The loop that runs one node under a clock that does not wait, over real links."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Final, NamedTuple

from mavlink_bridge.clocks.clock import Clock, SkewedClock
from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.links.link import Link
from mavlink_bridge.loops.deadlines import Deadlines
from mavlink_bridge.loops.histogram import Histogram, Spread
from mavlink_bridge.loops.inbox import CAPACITY, Inbox
from mavlink_bridge.loops.lockstep import Direction, Scheduled, Tap
from mavlink_bridge.node import Datagram

_NAP: Final = 100_000
# µs; someone who wants the loop to stop waits no longer than this and one step.


class Statistics(NamedTuple):
    """How a run went. ``steps``: all that were not excused; ``misses``: those that began too late;
    ``skipped``: deadlines without a step; ``lateness``: from the deadline to the beginning of a step;
    ``busy``: from there to its end, with receiving, sending and taps; ``overruns``: datagrams dropped because
    too many waited; ``unrouted``: datagrams on a link that leads nowhere."""

    steps: int
    misses: int
    skipped: int
    lateness: Spread
    busy: Spread
    overruns: int
    unrouted: int


class RealTime:
    """Runs ``scheduled.node`` at phase + k period (µs), from the first such instant that is not past, of
    ``clock``, or of the node's own clock if ``scheduled`` has one. The node is told the deadline, not the
    instant at which it really runs, which is less than a period later: so its own periods divide evenly, and
    the low two bits of every time are free for a tlog's link.

    ``links``: by the node's name for a link, the link or several; what the node sends goes to all of them.
    The links belong to the loop, which closes them in the end. ``on_idle(µs)`` is told after each step how
    long nothing will happen. ``excused()`` is asked before each step whether something held it up on purpose:
    then its lateness counts nowhere. See ``Deadlines`` for ``tolerance``, ``Inbox`` for ``capacity``.

    Raises ScheduleError for periods and phases off the grid.
    """

    def __init__(
        self,
        scheduled: Scheduled,
        links: Mapping[str, Link | Sequence[Link]],
        clock: Clock,
        taps: Sequence[Tap] = (),
        *,
        tolerance: int | None = None,
        capacity: int = CAPACITY,
        on_idle: Callable[[int], None] | None = None,
        excused: Callable[[], bool] = lambda: False,
    ) -> None:
        self._node = scheduled.node
        try:
            self.deadlines = Deadlines(scheduled.period, scheduled.phase, tolerance)
        except ScheduleError as error:
            raise ScheduleError(f"{scheduled.node.name}: {error}") from None
        self._links = {
            name: tuple(links) if isinstance(links, Sequence) else (links,) for name, links in links.items()
        }
        self._skew = NodeClock() if scheduled.clock is None else scheduled.clock
        self._clock = SkewedClock(clock, self._skew)
        self._taps = tuple(taps)
        self._capacity = capacity
        self._on_idle = on_idle
        self._excused = excused
        self.busy = Histogram()
        self._overruns = self._unrouted = 0

    @property
    def statistics(self) -> Statistics:
        """So far. For figures over several loops put ``deadlines.lateness`` and ``busy`` together."""
        due = self.deadlines
        return Statistics(
            due.lateness.count,
            due.misses,
            due.skipped,
            due.lateness.spread,
            self.busy.spread,
            self._overruns,
            self._unrouted,
        )

    def run(
        self, stop: Callable[[], bool], on_step: Callable[[int], bool | None] | None = None
    ) -> Statistics:
        """Run until ``stop()`` is true (asked before every step, from this thread) or ``on_step(now)``,
        called after every step with true time, returns True. Once: the links are closed, whatever the end.
        """
        clock, due = self._clock, self.deadlines
        with ExitStack() as cleanup:
            for links in self._links.values():
                for link in links:
                    cleanup.callback(link.close)
            inbox = Inbox(
                [(name, link) for name, links in self._links.items() for link in links], self._capacity
            )
            cleanup.callback(inbox.close)
            deadline = due.first(max(clock.now(), self._skew.reading(due.phase)))
            while self._wait(deadline, stop):
                began = clock.now()
                deadline = due.begin(deadline, began, excused=self._excused())
                self._step(deadline, inbox)
                over = on_step is not None and on_step(self._skew.instant(deadline))
                ended = clock.now()
                self.busy.add(ended - began)
                if over:
                    break
                deadline = due.after(deadline)
                if self._on_idle is not None:
                    self._on_idle(deadline - ended)
        return self.statistics

    def _wait(self, deadline: int, stop: Callable[[], bool]) -> bool:
        """Until ``deadline``; False if it is time to stop."""
        clock = self._clock
        while not stop():
            nap = clock.now() + _NAP
            if nap >= deadline:
                clock.wait_until(deadline)
                return not stop()
            clock.wait_until(nap)
        return False

    def _step(self, now: int, inbox: Inbox) -> None:
        arrived = inbox.take()
        self._overruns = inbox.overruns
        # Taps come last, so that writing a log makes no set-point late; but what a node fails at is logged.
        try:
            leaving = self._node.step(now, arrived)
            self._send(leaving)
        finally:
            self._show(now, "in", arrived)
        self._show(now, "out", leaving)

    def _send(self, datagrams: Sequence[Datagram]) -> None:
        for name, data in datagrams:
            links = self._links.get(name)
            if not links:
                self._unrouted += 1
                continue
            for link in links:
                link.send(data)

    def _show(self, now: int, direction: Direction, datagrams: Sequence[Datagram]) -> None:
        for tap in self._taps:
            if direction == "in":
                tap.begin(now, self._node.name)
            for datagram in datagrams:
                tap(now, self._node.name, direction, datagram)
