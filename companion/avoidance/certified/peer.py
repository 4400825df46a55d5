"""One peer as a vehicle knows it: its plans, its statements, and the agreements with it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from companion.avoidance.certified.agreed_planes import AgreedPlanes
from companion.avoidance.certified.committed import carried_on
from companion.avoidance.certified.pair import Agreement, Pair
from companion.avoidance.certified.peer_plans import PlanFile, StoredPlan
from mavlink_bridge.wire.agreements import Entry, Statement

_CONFLICT_US = 5_000_000
"""Time (µs) after contradicting plans during which no agreement is made with their sender."""
_SEEN = 8
"""Number of a peer's statements of which repetitions are recognised, which takes 0.6 µs instead of 7 µs."""
_ROUND_TRIP_US = 200_000
"""Round trip (µs) that is assumed before one was measured."""


class Lists(NamedTuple):
    """Agreements with a peer at one time: the own list, the newest considered one, and their planes."""

    kept: tuple[Agreement, ...]
    considered: Agreement
    agreed: dict[Agreement, AgreedPlanes]


class Peer:
    """State of the peer ``system`` as the vehicle ``own`` knows it; ``parts``: see ``Pair``.

    ``names``: the vehicles of its entries, and whether it has accepted their farewells. ``left``: the last
    plan of a peer whose farewell is accepted. ``departed``: so it is, or was until an own farewell that still
    lasts, with no later plan or statement of it. ``away``: another controller flies it. ``outside``: by how
    much (m) its distance from its plan exceeds the tube. ``contradicted``: it has sent two plans of one
    epoch, or was met, and no agreement was confirmed since. ``last_received``: time (µs) of its last plan or
    statement.
    ``round_trip`` (µs): from a proposal to its answer. ``changed``: the entry about it has changed since it
    was last stated. ``settled``: the own newest plan with which the negotiation had nothing to do, and has
    nothing to do until ``settled_until`` (µs) if nothing new is known of the peer; None: it must look.
    ``agreed``: the planes of all agreements that the own list holds. ``begun`` (µs): the latest ``since`` of
    its statements. Older plans do not show where it is.
    """

    def __init__(self, own: int, system: int, *, parts: bool = False) -> None:
        self._own = own
        self.plans, self.pair = PlanFile(), Pair(own, system, parts=parts)
        self.agreed: dict[Agreement, AgreedPlanes] = {}
        self.names: dict[int, bool] = {}
        self.left: StoredPlan | None = None
        self.departed = self.away = self.contradicted = False
        self.outside = 0.0
        self.last_received: int | None = None
        self.last_payload = b""
        self.round_trip = _ROUND_TRIP_US
        self.changed = True
        self.settled: StoredPlan | None = None
        self.settled_until = 0.0
        self._statement_epoch = self.begun = 0
        self._proposed: dict[Agreement, int] = {}
        self._seen: dict[Statement, tuple[tuple[Agreement, ...], Agreement]] = {}
        self._conflict: int | None = None

    def doubted(self, now: int) -> bool:
        """Return whether two vehicles with the peer's id have sent plans recently."""
        return self._conflict is not None and now - self._conflict < _CONFLICT_US

    def receive_plan(self, now: int, plan: StoredPlan) -> bool:
        """File a plan of the peer.

        Returns False if it contradicts a filed plan: two vehicles have this id, see ``contradict``.
        """
        self.settled = None
        if self.plans.add(plan, (one.other for one in self.pair.referenced())):
            self.last_received = now
            self._end_departure(plan)
            return True
        self.contradict(now)
        return False

    def contradict(self, now: int) -> None:
        """Discard all agreements, and make none for some time: two vehicles have this id.

        The own plan keeps the agreements until there is a new one, because without an agreement it is carried
        on.
        """
        self._conflict, self.contradicted = now, True
        self.void()

    @property
    def stated(self) -> bool:
        """Whether a statement of the peer was received: its sender has the fleet's fingerprint."""
        return self._statement_epoch > 0

    def _end_departure(self, plan: StoredPlan) -> None:
        """Take the peer for back if ``plan`` is later than its last plan, and not that plan carried on."""
        if self.left is None or plan.plan.epoch <= self.left.plan.epoch:
            return
        last = self.left.plan
        if carried_on(last, (plan.plan.epoch - last.epoch) // last.dt) != plan.plan:
            self._return()

    def _return(self) -> None:
        self.left, self.departed, self.settled = None, False, None

    def receive(self, now: int, statement: Statement, since: int) -> bool:
        """Receive a statement of the peer; return whether names, farewell or return have changed.

        ``since`` (µs): epoch of the first own plan since the own last beginning; 0 before it, and during
        an own farewell: then no farewell is accepted.
        A farewell means that the peer's plan of that epoch is its last. It is accepted with this plan once
        this plan has begun, if no newer plan is known, and if its sender has considered an own plan of
        ``since`` or later. It is repeated for receivers of which this is not true yet.
        """
        known = self.pair.kept, self.pair.considered
        if self.left is None and self._seen.get(statement) == known:
            # A repeated statement changes no agreement.
            self.last_received = now
            return self._receive_head(statement)
        changed = self._receive_head(statement)
        if statement.away:
            self.settled, self.last_received = None, now
            return changed
        if self.left is not None:
            if statement.epoch <= self.left.plan.epoch:
                return changed
            if not statement.farewell or statement.since > self.left.plan.epoch:
                # It has returned; a farewell of the same departure has the same ``since``.
                self._return()
                changed = True
        elif not statement.farewell:
            self.departed = False
        self.last_received = now
        if statement.farewell:
            self.settled = None
            accepted = statement.epoch <= now and self._answers(statement, since)
            return (accepted and self._part(statement.epoch)) or changed
        for entry in statement.entries:
            if entry.peer == self._own:
                self.settled = None
                self.changed |= self.pair.receive(statement.epoch, statement.since, entry)
                self._measure(now)
        if len(self._seen) >= _SEEN:
            self._seen.clear()
        self._seen[statement] = self.pair.kept, self.pair.considered
        return changed

    def _receive_head(self, statement: Statement) -> bool:
        """Receive what the newest statement alone tells; return whether the names have changed."""
        if not statement.away:
            # A vehicle under another controller makes no plan; its next ``since`` comes with one.
            self.begun = max(self.begun, statement.since)
        if statement.epoch < self._statement_epoch:
            return False
        self._statement_epoch, self.away = statement.epoch, statement.away
        self.outside = statement.outside
        changed, names = False, self.names
        for peer, _, _, departed in statement.entries:
            if peer != self._own and names.get(peer) is not departed:
                names[peer], changed = departed, True
        return changed

    def begin(self) -> None:
        """Discard the agreements, because the own plan begins anew; also after an own farewell."""
        self.void()
        self.departed = self.left is not None

    def _answers(self, farewell: Statement, since: int) -> bool:
        """Return whether the sender of ``farewell`` has considered an own plan of ``since`` (µs) or later.

        Then it sent this farewell after the own last beginning, see docs/certified.md.
        """
        considered = (entry.considered[1] for entry in farewell.entries if entry.peer == self._own)
        return since > 0 and any(epoch >= since for epoch in considered)

    def _part(self, epoch: int) -> bool:
        """Accept the farewell with the plan of ``epoch`` (µs) if no newer plan is known; return whether."""
        plan = self.plans.get(epoch)
        if plan is None or plan is not self.plans.newest:
            return False
        self.left, self.departed = plan, True
        self.void(epoch + 1)
        return True

    def leave(self, epoch: int) -> None:
        """Discard the agreements and the farewell of the peer, at an own farewell with the plan of ``epoch``.

        The peer's newest plan counts as considered, so that the farewell answers it.
        """
        self.left = None
        self.void()
        if self.plans.newest is not None:
            self.pair.refuse(Agreement(epoch, self.plans.newest.plan.epoch))

    def void(self, others_since: int = 0) -> None:
        """Discard all agreements with the peer, see ``Pair.void``."""
        self.settled = None
        self.pair.void(others_since)
        self.agreed.clear()
        self._proposed.clear()
        self.changed = True

    def part(self) -> None:
        """Discard all agreements with the peer, which is beyond the range."""
        self.void()
        self._seen.clear()

    def meet(self) -> None:
        """Count the peer, which is within the range: a first agreement needs plans that are far enough apart.

        Nothing else is known of its plans than these.
        """
        self.settled = None
        self.contradicted = self.changed = True

    def agree(self, one: Agreement, planes: AgreedPlanes) -> None:
        """Take the agreement ``one``, with its ``planes``."""
        self.pair.take(one)
        self.agreed = {other: known for other, known in self.agreed.items() if other in self.pair.kept}
        self.agreed[one] = planes
        self.changed = True

    def propose(self, now: int, one: Agreement, planes: AgreedPlanes) -> None:
        """Take the agreement ``one``, which the peer has not stated, with its ``planes``."""
        self.agree(one, planes)
        self._proposed[one] = now

    def lists(self) -> Lists:
        """Return what ``undo`` returns to."""
        return Lists(self.pair.kept, self.pair.considered, self.agreed)

    def undo(self, lists: Lists) -> None:
        """Return to earlier ``lists``: what was taken, proposed or dropped since was never stated."""
        self.pair.undo(lists.kept, lists.considered)
        self.agreed = lists.agreed
        self._proposed = {one: since for one, since in self._proposed.items() if one in lists.kept}
        self.settled, self.changed = None, True

    def waiting(self, now: int) -> int | None:
        """Return the time (µs) since the newest unanswered proposal; None if each is answered."""
        open_ = self.pair.open
        return min((now - self._proposed.get(one, now) for one in open_), default=None)

    def _measure(self, now: int) -> None:
        """Measure the round trip of the proposals that the peer has answered."""
        pending = set(self.pair.open)
        for one in [one for one in self._proposed if one not in pending]:
            self.round_trip += (now - self._proposed.pop(one) - self.round_trip) // 4

    def entry(self) -> Entry:
        """Return the entry to state about the peer, and count it as stated."""
        self.changed = False
        return self.pair.entry(departed=self.departed)

    def needed(self) -> Iterable[int]:
        """Return the epochs (µs) of the own plans that agreements and offers name."""
        return (one.own for one in self.pair.referenced())
