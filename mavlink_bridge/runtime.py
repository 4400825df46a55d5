"""The loop that runs nodes in lock-step under simulated time: one process, bit-identical whatever the order
of the nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from heapq import heapify, heapreplace
from itertools import pairwise
from typing import Literal, NamedTuple, Protocol

from mavlink_bridge.errors import ScheduleError
from mavlink_bridge.ether import Ether
from mavlink_bridge.node import Datagram, Node

Direction = Literal["in", "out"]

QUANTUM = 4
"""µs; the two low bits of a tlog's time stamp carry the link."""


class Scheduled(NamedTuple):
    """``node`` is due at ``phase`` + k ``period`` (µs, k = 0, 1, …)."""

    node: Node
    period: int
    phase: int = 0


class Tap(Protocol):
    """Sees every datagram as it enters (``in``) or leaves (``out``) a node; must not change anything."""

    def __call__(self, now: int, node: str, direction: Direction, datagram: Datagram, /) -> None:
        """At ``now`` µs."""
        ...


class LockStep:
    """Runs ``scheduled`` nodes over ``ether``. All times are µs and whole multiples of ``base_tick``, which
    is one of 4 µs.

    Within a tick all due nodes first receive, then all step, then everything is sent: no node sees another's
    output of the same tick. Raises ScheduleError for periods or phases off the grid and for names used twice.
    """

    def __init__(
        self, scheduled: Iterable[Scheduled], ether: Ether, base_tick: int, taps: Sequence[Tap] = ()
    ) -> None:
        self._scheduled = sorted(scheduled, key=lambda entry: entry.node.name)
        self._ether = ether
        self._taps = tuple(taps)
        self._now = 0
        if base_tick <= 0 or base_tick % QUANTUM:
            raise ScheduleError(f"base tick = {base_tick} µs is not a positive multiple of {QUANTUM} µs")
        for node, period, phase in self._scheduled:
            if period <= 0 or period % base_tick:
                raise ScheduleError(
                    f"{node.name}: period = {period} µs is not a positive multiple of {base_tick} µs"
                )
            if phase < 0 or phase % base_tick:
                raise ScheduleError(f"{node.name}: phase = {phase} µs is not a multiple of {base_tick} µs")
        names = [entry.node.name for entry in self._scheduled]
        for name, following in pairwise(names):
            if name == following:
                raise ScheduleError(f"two nodes are named {name!r}")
        # The index breaks ties by name, so that taps are called in one order whatever the order given.
        self._due = [(entry.phase, index) for index, entry in enumerate(self._scheduled)]
        heapify(self._due)

    @property
    def now(self) -> int:
        """Every tick before this instant (µs) has been run."""
        return self._now

    def run(self, until: int, on_tick: Callable[[int], bool | None] | None = None) -> None:
        """Run all ticks from ``now`` to before ``until`` (µs); ``run(a); run(b)`` is ``run(b)``.

        Ticks on which no node is due are skipped. ``on_tick(time)`` is called after each tick that was run;
        if it returns True the run ends there.
        """
        due = self._due
        while due and due[0][0] < until:
            now = due[0][0]
            self._tick(now, self._pop_due(now))
            self._now = now + 1
            if on_tick is not None and on_tick(now):
                return
        self._now = max(self._now, until)

    def _pop_due(self, now: int) -> list[Node]:
        nodes = []
        while self._due[0][0] == now:
            index = self._due[0][1]
            node, period, _ = self._scheduled[index]
            heapreplace(self._due, (now + period, index))
            nodes.append(node)
        return nodes

    def _tick(self, now: int, nodes: list[Node]) -> None:
        ether = self._ether
        inboxes = [ether.receive(now, node.name) for node in nodes]
        self._show(now, "in", nodes, inboxes)
        outboxes = [node.step(now, inbox) for node, inbox in zip(nodes, inboxes, strict=True)]
        self._show(now, "out", nodes, outboxes)
        for node, outbox in zip(nodes, outboxes, strict=True):
            ether.send(now, node.name, outbox)

    def _show(self, now: int, direction: Direction, nodes: list[Node], boxes: list[list[Datagram]]) -> None:
        for tap in self._taps:
            for node, box in zip(nodes, boxes, strict=True):
                for datagram in box:
                    tap(now, node.name, direction, datagram)
