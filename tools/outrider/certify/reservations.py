"""Reservations: an autopilot is ordered to take off or to land only in a column that all others keep."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from companion.avoidance.certified.committed import carried_on, controls
from companion.avoidance.certified.separating_planes import hull_distance
from mavlink_bridge.wire.agreements import Epochs
from mavlink_bridge.wire.plan import WirePlan
from outrider.certify.evidence import Finding, Order, Terms
from outrider.certify.histories import History, Kind
from outrider.certify.ranges import Ranges

_SLACK_US = 20_000
"""Time (µs) by which a record may be written after the step of the companion to which it belongs."""
_SLACK_M = 2e-6
"""Tolerance (m): columns are kept to 1 µm, and floating-point errors."""


class Peer(Protocol):
    """What the log has shown about the agreements with one peer."""

    @property
    def agreed(self) -> bool:
        """Whether an agreement of the own list was stated by the peer, and is not void."""
        ...

    @property
    def departed(self) -> bool:
        """Whether the peer's farewell is accepted."""
        ...

    @property
    def listed(self) -> tuple[Epochs, ...]:
        """Agreements of the own list."""
        ...

    @property
    def newest(self) -> WirePlan | None:
        """Newest plan of the peer that was received."""
        ...


class Reservations:
    """Since when the column of one vehicle is reserved, as its log is gone through.

    With ``ranges`` an agreement is needed with those alone that were within the range.
    """

    def __init__(self, history: History, terms: Terms, ranges: Ranges | None = None) -> None:
        self._owner, self._terms, self._ranges = history.system, terms, ranges
        self._steps = history.steps
        self._columns = {step.plan.epoch for step in history.steps if step.plan.column}
        self._since: int | None = None
        self._last = 0
        self._peers: Mapping[int, Peer] = {}
        self._unreserved: set[int] = set()

    def see(self, time: int, peers: Mapping[int, Peer]) -> None:
        """Take note of what holds after a record at ``time`` (µs)."""
        self._peers = peers
        self._unreserved = {
            system
            for system in self._terms.fleet
            if system != self._owner
            and not self._keeps(peers.get(system))
            and not (self._ranges is not None and self._ranges.is_unheard(system, time))
        }
        if self._unreserved:
            self._since = None
            return
        self._last = time
        if self._since is None:
            self._since = time

    def _keeps(self, peer: Peer | None) -> bool:
        if peer is None:
            return False
        return peer.departed or (peer.agreed and all(one[0] in self._columns for one in peer.listed))

    def judge(self, order: Order) -> Iterable[Finding]:
        """Yield what is wrong with ``order``: between the reservation and it an epoch begins and ends."""
        flown = [step.plan for step in self._steps if step.plan.epoch <= order.time]
        if not flown and not order.climbs:
            # A companion without a plan passes an operator's order to land on.
            return
        what = f"a {'climb' if order.climbs else 'descent'} without a reservation"
        missing, beside = "", self._unreserved
        if not flown or not flown[-1].column:
            missing = "its plan is no column"
        elif self._unreserved:
            missing = f"not reserved beside {_listed(self._unreserved)}"
        elif self._since is None or self._epoch(order.time) < self._epoch(self._since - _SLACK_US) + 2:
            missing = "reserved for less than an epoch"
        elif not _rests(flown[-1], order.time + _SLACK_US):
            missing = "its column does not rest"
        elif near := self._near(flown[-1]):
            missing, beside = f"the last plan of {_listed(near)} is too near", near
        if missing:
            yield Finding(what, (self._owner, *sorted(beside)), order.time, missing)

    def released(self, epoch: int, system: int) -> str:
        """Return why the column may not become a plan in space at ``epoch`` (µs) beside ``system``, or "".

        There is no agreement with ``system``. Its newest plan must be away from the column, and the column
        must have been reserved before.
        """
        own: WirePlan | None = None
        for step in reversed(self._steps):
            # In a gap the plan before is carried on: a step that was late makes none.
            if step.plan.epoch < epoch:
                if not step.plan.column:
                    break
                own = step.plan
                if step.kind is Kind.ANCHOR:
                    break
        newest = None if system not in self._peers else self._peers[system].newest
        if own is None or self._last < own.epoch:
            return "its column was not reserved"
        if newest is None:
            return "no plan of it was received"
        return "" if self._away(own, newest) else "its plan is too near the column"

    def _epoch(self, time: int) -> int:
        """Return the number of the epoch that holds ``time`` (µs)."""
        return time // self._terms.epoch

    def _near(self, column: WirePlan) -> set[int]:
        """Return the vehicles whose farewell is accepted and whose last plan is too near the ``column``."""
        lasts = {system: peer.newest for system, peer in self._peers.items() if peer.departed}
        return {system for system, last in lasts.items() if last and not self._away(column, last)}

    def _away(self, column: WirePlan, other: WirePlan) -> bool:
        """Return whether two plans are far enough from each other horizontally, from the later one on."""
        epoch = max(column.epoch, other.epoch)
        one, two = (controls(carried_on(plan, (epoch - plan.epoch) // plan.dt)) for plan in (column, other))
        apart = one - two
        apart[..., 2] = 0.0
        least = self._terms.required + (1 + other.column) * self._terms.further
        return float(hull_distance(apart).min()) >= least - _SLACK_M


def _rests(plan: WirePlan, time: int) -> bool:
    """Return whether ``plan`` is at rest at ``time`` (µs)."""
    later = carried_on(plan, max(time - plan.epoch, 0) // plan.dt)
    return not any(map(any, (later.velocity, *later.accelerations)))


def _listed(systems: set[int]) -> str:
    return ", ".join(map(str, sorted(systems)))
