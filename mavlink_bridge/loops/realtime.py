"""Loop that runs one node under a wall clock, over real links."""

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
from mavlink_bridge.loops.lockstep import Direction, Scheduled, StepObserver
from mavlink_bridge.node import Datagram

_STOP_POLL_US: Final = 100_000
"""A request to stop takes effect after at most this time and one step."""


class Statistics(NamedTuple):
    """Statistics of a run.

    - ``steps``: all steps that were not excused
    - ``misses``: steps that began more than the tolerance late
    - ``skipped``: deadlines without a step, except those skipped by excused steps
    - ``lateness``: from the deadline to the beginning of a step (µs)
    - ``busy``: from the beginning to the end of a step, with receiving, sending, taps and ``on_step`` (µs)
    - ``overruns``: datagrams dropped because too many waited
    - ``unrouted``: datagrams sent to a link name that ``links`` lacks
    """

    steps: int
    misses: int
    skipped: int
    lateness: Spread
    busy: Spread
    overruns: int
    unrouted: int


class RealTime:
    """Loop that steps ``scheduled.node`` at phase + k period (µs).

    Deadlines are on the node's own clock if ``scheduled`` has one, otherwise on ``clock``. The first is the
    earliest that is neither past nor before the phase. The node receives the deadline; the step begins less
    than a period after it. So the node's own periods divide evenly, and the low two bits of every time are
    free for a tlog's link.

    ``links`` maps the node's name for a link to one or several links; what the node sends goes to all of
    them. The loop owns the links and closes them at the end. After each step the loop calls ``on_idle(µs)``
    with the time until the next deadline, negative if it has passed. Before each step it calls ``excused()``,
    which returns whether the step was delayed on purpose; the lateness of such a step is not counted. See
    ``Deadlines`` for ``tolerance``, ``Inbox`` for ``capacity``.

    Raises ScheduleError for an invalid period or phase.
    """

    def __init__(
        self,
        scheduled: Scheduled,
        links: Mapping[str, Link | Sequence[Link]],
        clock: Clock,
        taps: Sequence[StepObserver] = (),
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
        """Statistics of the run so far.

        For figures over several loops, combine ``deadlines.lateness`` and ``busy``.
        """
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
        """Run until ``stop()`` or ``on_step(now)`` returns True, and return the statistics.

        This thread calls ``stop`` before every step and every 100 ms while it waits, and ``on_step`` after
        every step, with the deadline in true time. The loop runs only once: it closes the links in any case.
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
        """Wait until ``deadline``; return False, possibly before it, if the loop shall stop."""
        clock = self._clock
        while not stop():
            pause_end = clock.now() + _STOP_POLL_US
            if pause_end >= deadline:
                clock.wait_until(deadline)
                return not stop()
            clock.wait_until(pause_end)
        return False

    def _step(self, now: int, inbox: Inbox) -> None:
        arrived = inbox.take()
        self._overruns = inbox.overruns
        # Taps run last, so that writing a log delays no set-point. ``finally`` logs the input on which a node
        # fails.
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
            if datagrams:
                tap(now, self._node.name, direction, datagrams)
