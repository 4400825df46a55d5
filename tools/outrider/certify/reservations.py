"""Reservations: an autopilot is ordered to take off or to land only in a column that all others keep."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from mavlink_bridge.wire.agreements import Epochs
from outrider.certify.evidence import Finding, Order, Terms
from outrider.certify.histories import History

_SLACK_US = 1_000
"""Tolerance for the time at which a record was written (µs)."""


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


class Reservations:
    """Since when the column of one vehicle is reserved, as its log is gone through."""

    def __init__(self, history: History, terms: Terms) -> None:
        self._owner, self._terms = history.system, terms
        self._steps = history.steps
        self._columns = {step.plan.epoch for step in history.steps if step.plan.column}
        self._since: int | None = None
        self._unreserved: set[int] = set()

    def see(self, time: int, peers: Mapping[int, Peer]) -> None:
        """Take note of what holds after a record at ``time`` (µs)."""
        self._unreserved = {
            system
            for system in self._terms.fleet
            if system != self._owner and not self._keeps(peers.get(system))
        }
        if self._unreserved:
            self._since = None
        elif self._since is None:
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
        missing = ""
        if not flown or not flown[-1].column:
            missing = "its plan is no column"
        elif self._unreserved:
            missing = f"not reserved beside {', '.join(map(str, sorted(self._unreserved)))}"
        elif self._since is None or order.time < self._since + self._terms.epoch - _SLACK_US:
            missing = "reserved for less than an epoch"
        if missing:
            yield Finding(what, (self._owner, *sorted(self._unreserved)), order.time, missing)
