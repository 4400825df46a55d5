"""Loop that runs nodes in lock-step under simulated time, in one process.

The result is bit-identical whatever the order of the nodes. Each node may have a clock of its own, hang for a
while, or vanish.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
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
"""Number of datagrams that wait for a hung node; about what a UDP socket holds by default on Linux."""


class Scheduled(NamedTuple):
    """A node and its timing.

    ``node`` is due whenever its clock shows ``phase`` + k ``period`` (µs, k an integer), for the first time
    not before the true time ``phase``. The node receives the time that its clock shows.

    Without a ``clock`` that is true time: due at ``phase``, ``phase`` + ``period``, …
    """

    node: Node
    period: int
    phase: int = 0
    clock: NodeClock | None = None


class StepObserver(Protocol):
    """Observer of every step of a node and of every datagram that enters (``in``) or leaves (``out``) it.

    An observer must not change anything.
    """

    def begin(self, now: int, node: str, /) -> None:
        """Announce the step of ``node`` at ``now``; the datagrams that enter and leave it then follow."""
        ...

    def __call__(self, now: int, node: str, direction: Direction, datagram: Datagram, /) -> None:
        """Observe a datagram at ``now`` (µs) of the node's clock; true time is the loop's ``now``."""
        ...


class LockStep:
    """Loop that steps ``scheduled`` nodes over ``network`` in simulated time.

    All times are µs; periods and phases are whole multiples of ``base_tick``, which is a multiple of 4 µs.
    For a hung node up to ``buffer`` datagrams wait.

    Within a tick all due nodes first receive, then all step, then everything is sent: no node sees another's
    output of the same tick. A node whose clock deviates from true time is due at the first tick at which its
    clock shows the deadline or more, so its steps drift relative to those of the others; a tick steps it at
    most once.

    Raises ScheduleError for periods or phases off the grid, for names used twice, and for a clock that shows
    a negative time.
    """

    def __init__(
        self,
        scheduled: Iterable[Scheduled],
        network: SimulatedNetwork,
        base_tick: int,
        taps: Sequence[StepObserver] = (),
        buffer: int = BUFFER,
    ) -> None:
        entries = sorted(scheduled, key=lambda entry: entry.node.name)
        self._network = network
        self._taps = tuple(taps)
        self._buffer = buffer
        self._now = 0
        if base_tick <= 0 or base_tick % QUANTUM:
            raise ScheduleError(f"base tick = {base_tick} µs is not a positive multiple of {QUANTUM} µs")
        for node, period, phase, _ in entries:
            if period <= 0 or period % base_tick:
                raise ScheduleError(
                    f"{node.name}: period = {period} µs is not a positive multiple of {base_tick} µs"
                )
            if phase < 0 or phase % base_tick:
                raise ScheduleError(f"{node.name}: phase = {phase} µs is not a multiple of {base_tick} µs")
        for one, following in pairwise(entries):
            if one.node.name == following.node.name:
                raise ScheduleError(f"two nodes are named {one.node.name!r}")
        self._slots = [Schedule(*entry, base_tick) for entry in entries]
        # Remaining buffer capacity of each hung node.
        self._hanging: dict[str, int] = {}
        self._vanished: set[str] = set()
        # The index breaks ties by name, so that taps are called in one order whatever the order given.
        self._due = [(slot.first(), index) for index, slot in enumerate(self._slots)]
        heapify(self._due)

    @property
    def now(self) -> int:
        """Time (µs, true time) before which every tick has been run."""
        return self._now

    def run(self, until: int, on_tick: Callable[[int], bool | None] | None = None) -> None:
        """Run all ticks before ``until`` (µs), starting at the loop's ``now``.

        ``run(a); run(b)`` is the same as ``run(b)``. Ticks on which no node is due are skipped.
        ``on_tick(time)`` is called after each tick that was run; if it returns True the run ends there.
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
        """Suspend node ``name``: it is not stepped, and what arrives for it waits in its buffer.

        When the buffer is full, new datagrams are dropped. The node's clock continues. Raises ScheduleError
        for an unknown name.
        """
        self._index_of(name)
        self._hanging.setdefault(name, self._buffer)

    def thaw(self, name: str) -> None:
        """Resume node ``name`` at its next deadline with all datagrams that waited.

        Missed deadlines are not made up for. The call has no effect on a node that has vanished. Raises
        ScheduleError for an unknown name.
        """
        self._index_of(name)
        if name not in self._vanished:
            self._hanging.pop(name, None)

    def vanish(self, name: str) -> None:
        """Remove node ``name`` for good: it is never stepped again, and all its input is dropped.

        Raises ScheduleError for an unknown name.
        """
        self._index_of(name)
        self._hanging[name] = 0
        self._vanished.add(name)

    def _index_of(self, name: str) -> int:
        names = [slot.name for slot in self._slots]
        if name not in names:
            raise ScheduleError(f"no node is named {name!r}; there are {', '.join(names)}")
        return names.index(name)

    def _pop_due(self, now: int) -> list[Schedule]:
        due, slots = self._due, []
        while due[0][0] == now:
            index = due[0][1]
            slot = self._slots[index]
            heapreplace(due, (slot.after(now), index))
            slots.append(slot)
        return slots

    def _tick(self, now: int, slots: list[Schedule]) -> None:
        network = self._network
        if self._hanging:
            slots = self._running(now, slots)
        times = [slot.told(now) for slot in slots]
        inboxes = [network.receive(now, slot.name) for slot in slots]
        if self._taps:
            self._show(times, slots, "in", inboxes)
        outboxes = [slot.step(time, inbox) for slot, time, inbox in zip(slots, times, inboxes, strict=True)]
        if self._taps:
            self._show(times, slots, "out", outboxes)
        for slot, outbox in zip(slots, outboxes, strict=True):
            if outbox:
                network.send(now, slot.name, outbox)

    def _running(self, now: int, slots: list[Schedule]) -> list[Schedule]:
        """Return those of ``slots`` that are not hung; for the others, buffer what has arrived."""
        for slot in slots:
            room = self._hanging.get(slot.name)
            if room is not None:
                self._network.keep(now, slot.name, room)
        return [slot for slot in slots if slot.name not in self._hanging]

    def _show(
        self, times: list[int], slots: list[Schedule], direction: Direction, boxes: list[list[Datagram]]
    ) -> None:
        for tap in self._taps:
            for time, slot, box in zip(times, slots, boxes, strict=True):
                if direction == "in":
                    tap.begin(time, slot.name)
                for datagram in box:
                    tap(time, slot.name, direction, datagram)
