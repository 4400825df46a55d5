"""Lists of agreements of one vehicle, from the statements in its log: when one enters, and when one leaves.

An agreement is written as the owner of the log writes it: epochs (µs) of its own plan and of the peer's. The
records are gone through in their order, so a statement counts for those that follow it.

- An agreement enters a list if it is newer than all that the list's statements have considered before, if
  both plans are known to the vehicle, and if its newest plan is not older than either.
- It leaves by succession (a newer one of the list was stated by the peer), withdrawal (the peer has
  considered it, or a newer one, and its list lacks it), void (one of the two began anew after its plan, or
  the owner has said farewell) or the peer's farewell.
- A plan is made only if each peer that has not departed has stated an agreement of the list. A column that
  was reserved may become a plan in space without it, if the peer's newest plan is away from the column.
- A vehicle that begins anew, or returns, states this: ``since`` is later than its plans before.
- A farewell is accepted only if its sender has considered a plan of the receiver's last beginning or later.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, pairwise
from typing import NamedTuple

from mavlink_bridge.wire.agreements import Entry, Epochs, Statement
from mavlink_bridge.wire.plan import WirePlan
from outrider.certify.evidence import Finding, Log, LoggedPlan, LoggedStatement, Order, Terms
from outrider.certify.histories import History, Kind
from outrider.certify.ranges import Ranges
from outrider.certify.reservations import Reservations

_NONE: Epochs = (0, 0)


class Listing(NamedTuple):
    """Agreement of ``owner`` with ``peer``; ``first`` and ``last``: epochs (µs) of statements with it."""

    owner: int
    peer: int
    agreement: Epochs
    first: int
    last: int


class _Peer:
    """What the log of ``owner`` has shown so far about its agreements with one peer."""

    def __init__(self, owner: int, system: int) -> None:
        self._owner, self.system = owner, system
        self.listings: dict[Epochs, Listing] = {}
        self.listed: tuple[Epochs, ...] = ()
        self._considered = _NONE
        self._own_since = self._since = 0
        self._stated: set[Epochs] = set()
        self._lacking: list[tuple[int, Epochs, frozenset[Epochs]]] = []
        """Received: epoch of the statement, the newest considered agreement, and the list."""
        self._plans: dict[int, WirePlan] = {}
        self._departed = False
        """Whether the last own entry says that the peer's farewell is accepted."""
        self._left = False
        """Whether the owner has said farewell and has not begun anew."""
        self._farewell: int | None = None
        """Epoch of the last plan of a peer whose farewell was to be accepted."""

    def _rank(self, one: Epochs) -> tuple[int, int]:
        """Return the place of an agreement in the order of the pair."""
        return sum(one), one[self._owner > self.system]

    def receive_plan(self, plan: WirePlan) -> None:
        """Take note of a plan of the peer."""
        self._plans[plan.epoch] = plan

    def receive(self, statement: Statement) -> None:
        """Take note of a statement of the peer."""
        epoch = statement.epoch
        if statement.farewell:
            answers = any(
                entry.considered[1] >= self._own_since
                for entry in statement.entries
                if entry.peer == self._owner
            )
            if answers and self._plans and epoch == max(self._plans):
                self._farewell, self._since = epoch, max(self._since, epoch + 1)
            return
        if self._farewell is not None and epoch > self._farewell:
            self._farewell = None
        if statement.since < self._since:
            return
        self._since = statement.since
        for entry in statement.entries:
            if entry.peer == self._owner:
                stated = frozenset((own, other) for other, own in entry.agreements)
                self._stated |= stated
                self._lacking.append((epoch, entry.considered[::-1], stated))

    def state(self, statement: Statement, entry: Entry, ranges: Ranges | None) -> Iterable[tuple[str, str]]:
        """Take note of an own entry; yield kind and figures of what the rules forbid."""
        if statement.since > self._own_since:
            self._own_since, self._considered = statement.since, _NONE
            if self._left:
                # The farewells from before the own one do not count any more.
                self._left, self._farewell = False, None
        self._left |= statement.farewell
        self._departed = entry.departed
        before, now = set(self.listed), set(entry.agreements)
        for one in entry.agreements:
            if one not in before:
                yield from self._enters(statement, one)
                self.listings.setdefault(
                    one, Listing(self._owner, self.system, one, statement.epoch, statement.epoch)
                )
            self.listings[one] = self.listings[one]._replace(last=statement.epoch)
        for one in self.listed:
            last = self.listings[one].last
            parts = ranges is not None and ranges.may_part(self.system, last, statement.epoch)
            if one not in now and not parts and not self._leaves(one, entry):
                yield "an agreement dropped", self._named(one)
        self.listed = entry.agreements
        self._considered = max(self._considered, entry.considered, *entry.agreements, key=self._rank)
        if entry.departed and self._farewell is None:
            yield "a departure without a farewell", ""

    def _enters(self, statement: Statement, one: Epochs) -> Iterable[tuple[str, str]]:
        if self._rank(one) <= self._rank(self._considered):
            yield "an agreement taken again", self._named(one)
        if one[1] not in self._plans:
            yield "an agreement on a plan that was not received", self._named(one)
        if max(one) > statement.epoch:
            yield "an agreement on a plan newer than the own one", self._named(one)

    def _void(self, one: Epochs) -> bool:
        return self._left or one[0] < self._own_since or one[1] < self._since

    def _leaves(self, one: Epochs, entry: Entry) -> bool:
        rank = self._rank(one)
        return (
            self._void(one)
            or entry.departed
            or any(newer in self._stated and self._rank(newer) > rank for newer in entry.agreements)
            or any(
                epoch >= one[1] and one not in stated and self._rank(considered) >= rank
                for epoch, considered, stated in reversed(self._lacking)
            )
        )

    @property
    def departed(self) -> bool:
        """Whether the peer's farewell is accepted, or was to be."""
        return self._departed or self._farewell is not None

    @property
    def agreed(self) -> bool:
        """Whether an agreement of the own list was stated by the peer, and is not void."""
        return any(one in self._stated and not self._void(one) for one in self.listed)

    @property
    def newest(self) -> WirePlan | None:
        """Newest plan of the peer that was received."""
        return self._plans[max(self._plans)] if self._plans else None

    def _named(self, one: Epochs) -> str:
        return f"on plans of {one[0]} µs and {one[1]} µs"


def listings(
    log: Log, history: History, others: Sequence[History], terms: Terms
) -> tuple[list[Listing], list[Finding]]:
    """Return all agreements in the lists of the vehicle with this ``log`` and ``history``, and findings.

    ``others``: histories of the other vehicles.
    """
    owner = log.owner
    peers: dict[int, _Peer] = {}
    sent = {other.system: {step.plan for step in other.steps} for other in others}
    released = {step.plan.epoch for step in history.steps if step.kind is Kind.RELEASED}
    made = released.union(step.plan.epoch for step in history.steps if step.kind is Kind.MADE)
    named: dict[int, set[int]] = {epoch: set() for epoch in made}
    unstated = {
        step.plan.epoch: before.plan.epoch
        for before, step in pairwise(history.steps)
        if step.kind in (Kind.FIRST, Kind.ANCHOR)
    }
    findings: list[Finding] = []
    farewell: int | None = None
    elsewhere: dict[int, list[int]] = {}
    reach = terms.reach
    ranges = None if reach is None else Ranges(history, others, terms, reach)
    reservations = Reservations(history, terms, ranges)
    columns = log.orders or any(step.plan.column for step in history.steps)
    records: list[LoggedPlan | LoggedStatement | Order] = sorted(
        chain(log.sightings, log.statements, log.orders), key=lambda record: record.number
    )
    for record in records:
        if isinstance(record, Order):
            findings += reservations.judge(record)
            continue
        sender = record.sender
        if isinstance(record, LoggedPlan):
            if sender != owner and record.plan in sent.get(sender, ()):
                peers.setdefault(sender, _Peer(owner, sender)).receive_plan(record.plan)
            continue
        statement = record.statement
        if statement.fingerprint != terms.fleet_identity.fingerprint:
            if sender == owner:
                elsewhere.setdefault(statement.fingerprint, []).append(record.time)
        elif statement.away:
            continue
        elif sender != owner:
            peers.setdefault(sender, _Peer(owner, sender)).receive(statement)
        else:
            before = unstated.pop(statement.epoch, None)
            if before is not None and statement.since <= before:
                findings.append(Finding("a new beginning that is not stated", (owner,), statement.epoch, ""))
            if statement.farewell:
                farewell = statement.epoch
            elif farewell is not None:
                if statement.since <= farewell:
                    findings.append(Finding("a return that is not stated", (owner,), statement.epoch, ""))
                farewell = None
            for entry in statement.entries:
                peer = peers.setdefault(entry.peer, _Peer(owner, entry.peer))
                who = owner, peer.system
                wrong = peer.state(statement, entry, ranges)
                findings += [Finding(what, who, record.time, figures) for what, figures in wrong]
                present = named.get(statement.epoch)
                if present is None or peer.system in present:
                    continue
                present.add(peer.system)
                if entry.departed or statement.farewell or peer.agreed:
                    continue
                epoch, figures = statement.epoch, ""
                if ranges is not None:
                    allowed, figures = ranges.may_be_unheard(peer.system, epoch)
                    if allowed:
                        continue
                if epoch in released:
                    figures = reservations.released(epoch, peer.system)
                if figures or epoch not in released:
                    findings.append(Finding("a plan without an agreement", who, epoch, figures))
        if columns:
            reservations.see(record.time, peers)
    for epoch, present in named.items():
        unnamed = sorted(set(terms.fleet) - present - {owner})
        if ranges is not None:
            for system in unnamed:
                allowed, figures = ranges.may_be_unheard(system, epoch)
                if not allowed:
                    findings.append(Finding("a plan without an agreement", (owner, system), epoch, figures))
        elif unnamed:
            findings.append(Finding("a plan without a statement", (owner, *unnamed), epoch, ""))
    what, fleet = "a statement of another fleet", terms.fleet_identity.fingerprint
    for fingerprint, times in elsewhere.items():
        figures = f"fingerprint {fingerprint:08x}, the fleet's is {fleet:08x}, {len(times)} times"
        findings.append(Finding(what, (owner,), times[0], figures))
    return [one for peer in peers.values() for one in peer.listings.values()], findings
