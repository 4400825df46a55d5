"""Loop that runs nodes in lock-step under simulated time, in one process.

The result does not depend on the order of the nodes, to the bit. Each node may have a clock of its own, be
suspended for a while, or be removed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from heapq import heapify, heapreplace
from itertools import pairwise
from typing import Literal, NamedTuple, Protocol

from mavlink_bridge.clocks.node_clock import QUANTUM, NodeClock
from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.loops.schedule import Schedule
from mavlink_bridge.network.simulated import SimulatedNetwork
from mavlink_bridge.node import Datagram, Node

__all__ = ["BUFFER", "QUANTUM", "Direction", "LockStep", "Scheduled", "StepObserver"]

Direction = Literal["in", "out"]

BUFFER = 256
"""Default input buffer of a suspended node (datagrams): about what a UDP socket holds on Linux."""


class Scheduled(NamedTuple):
    """A node and its timing.

    Deadlines are at ``phase`` + k ``period`` (µs, k an integer) on the node's ``clock`` (None: true time);
    the first is not before the true time ``phase``. The node receives the time that its clock shows.
    """

    node: Node
    period: int
    phase: int = 0
    clock: NodeClock | None = None


class StepObserver(Protocol):
    """Observer of every step of a node and of all datagrams that enter (``in``) or leave (``out``) it.

    An observer must not change anything.
    """

    def begin(self, now: int, node: str, /) -> None:
        """Observe the beginning of a step of ``node`` at ``now`` (µs of the node's clock).

        Calls for the datagrams of the step follow: first for those that enter, then for those that leave.
        """
        ...

    def __call__(self, now: int, node: str, direction: Direction, datagrams: Sequence[Datagram], /) -> None:
        """Observe one or more datagrams of the step at ``now`` (µs of the node's clock)."""
        ...


class LockStep:
    """Loop that steps ``scheduled`` nodes over ``network`` in simulated time.

    All times are in µs. Periods and phases are whole multiples of ``base_tick``, which is a multiple of 4 µs.
    The input buffer of a suspended node holds up to ``buffer`` datagrams. ``taps`` observe all steps. Nodes
    ``elsewhere`` are stepped by another process: here only their ticks count, so that all processes run the
    same ticks.

    Within a tick all due nodes first receive, then all step, then everything is sent: no node receives the
    output of another node from the same tick. A node whose clock deviates from true time is due at the first
    tick at which its clock shows at least the deadline; its steps therefore drift relative to those of the
    other nodes. A tick steps a node at most once.

    Raises ScheduleError for an invalid tick, period or phase, for a name used twice, and for a clock that
    shows a negative time at the node's phase.
    """

    def __init__(
        self,
        scheduled: Iterable[Scheduled],
        network: SimulatedNetwork,
        base_tick: int,
        taps: Sequence[StepObserver] = (),
        buffer: int = BUFFER,
        elsewhere: Collection[str] = (),
    ) -> None:
        entries = sorted(scheduled, key=lambda entry: entry.node.name)
        self._network = network
        self._taps = tuple(taps)
        self._buffer = buffer
        self._elsewhere = frozenset(elsewhere)
        self._now = 0
        if base_tick <= 0 or base_tick % QUANTUM:
            raise ScheduleError(f"base tick = {base_tick} µs is not a positive multiple of {QUANTUM} µs")
        for node, period, phase, _ in entries:
            if period <= 0 or period % base_tick:
                raise ScheduleError(
                    f"{node.name}: period = {period} µs is not a positive multiple of {base_tick} µs"
                )
            if phase < 0 or phase % base_tick:
                raise ScheduleError(
                    f"{node.name}: phase = {phase} µs is not 0 or a positive multiple of {base_tick} µs"
                )
        for one, following in pairwise(entries):
            if one.node.name == following.node.name:
                raise ScheduleError(f"two nodes are named {one.node.name!r}")
        self._schedules = [Schedule(*entry, base_tick) for entry in entries]
        # Input buffer capacity (datagrams) of each suspended node; 0 for a removed one.
        self._suspended: dict[str, int] = {}
        self._vanished: set[str] = set()
        # Entries are sorted by name, so the index breaks ties by name: the order of calls to the taps does
        # not depend on the order of ``scheduled``.
        self._due = [(schedule.first(), index) for index, schedule in enumerate(self._schedules)]
        heapify(self._due)

    @property
    def now(self) -> int:
        """True time (µs); every tick before it has been run, none at or after it."""
        return self._now

    def run(self, until: int, on_tick: Callable[[int], bool | None] | None = None) -> None:
        """Run all ticks before ``until`` (µs), starting at the loop's ``now``.

        ``run(a); run(b)`` is the same as ``run(b)``. Ticks on which no node is due are skipped.
        ``on_tick(time)`` is called after each tick that was run; if it returns True, the run ends.
        """
        due = self._due
        while due and due[0][0] < until:
            now = self._now = due[0][0]
            self._tick(now, self._pop_due(now))
            self._now = now + 1
            if on_tick is not None and on_tick(now):
                return
        self._now = max(self._now, until)

    def freeze(self, name: str) -> None:
        """Suspend node ``name``: it is not stepped, and arriving datagrams wait in its input buffer.

        When the buffer is full, new datagrams are dropped. The node's clock continues. Raises ScheduleError
        for an unknown name.
        """
        self._index_of(name)
        self._suspended.setdefault(name, self._buffer)

    def thaw(self, name: str) -> None:
        """Resume node ``name`` at its next deadline; that step receives all buffered datagrams.

        Missed deadlines are skipped. The call has no effect on a removed node. Raises ScheduleError for an
        unknown name.
        """
        self._index_of(name)
        if name not in self._vanished:
            self._suspended.pop(name, None)

    def vanish(self, name: str) -> None:
        """Remove node ``name`` permanently: it is never stepped again, and its input is dropped.

        Raises ScheduleError for an unknown name.
        """
        self._index_of(name)
        self._suspended[name] = 0
        self._vanished.add(name)

    def _index_of(self, name: str) -> int:
        """Return the index of node ``name``; raise ScheduleError if there is none."""
        names = [schedule.name for schedule in self._schedules]
        if name not in names:
            raise ScheduleError(f"no node is named {name!r}; there are {', '.join(names)}")
        return names.index(name)

    def _pop_due(self, now: int) -> list[Schedule]:
        due, schedules = self._due, []
        while due[0][0] == now:
            index = due[0][1]
            schedule = self._schedules[index]
            heapreplace(due, (schedule.after(now), index))
            if schedule.name not in self._elsewhere:
                schedules.append(schedule)
        return schedules

    def _tick(self, now: int, schedules: list[Schedule]) -> None:
        network = self._network
        if self._suspended:
            schedules = self._running(now, schedules)
        times = [schedule.told(now) for schedule in schedules]
        inboxes = [network.receive(now, schedule.name) for schedule in schedules]
        if self._taps:
            self._show(times, schedules, "in", inboxes)
        outboxes = [
            schedule.step(time, inbox)
            for schedule, time, inbox in zip(schedules, times, inboxes, strict=True)
        ]
        if self._taps:
            self._show(times, schedules, "out", outboxes)
        for schedule, outbox in zip(schedules, outboxes, strict=True):
            if outbox:
                network.send(now, schedule.name, outbox)

    def _running(self, now: int, schedules: list[Schedule]) -> list[Schedule]:
        """Return the schedules of nodes that are not suspended; buffer arrivals for the suspended ones."""
        for schedule in schedules:
            room = self._suspended.get(schedule.name)
            if room is not None:
                self._network.keep(now, schedule.name, room)
        return [schedule for schedule in schedules if schedule.name not in self._suspended]

    def _show(
        self, times: list[int], schedules: list[Schedule], direction: Direction, boxes: list[list[Datagram]]
    ) -> None:
        for tap in self._taps:
            for time, schedule, box in zip(times, schedules, boxes, strict=True):
                if direction == "in":
                    tap.begin(time, schedule.name)
                if box:
                    tap(time, schedule.name, direction, box)
