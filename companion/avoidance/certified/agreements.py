"""Agreements of a vehicle with all its peers: what was received, and what its plans must keep.

A vehicle replans only if it and each member have an agreement that both state (``missing`` is empty). Members
are the expected vehicles, the senders of plans and statements, and the vehicles that these name, all until
their farewell. A vehicle that said farewell flies its last plan to the end and stays there; it needs no
agreement before it has begun anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from companion.avoidance.certified.agreed_planes import AgreedPlanes
from companion.avoidance.certified.committed import horizon_of
from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.avoidance.certified.negotiation import Geometry, Negotiation
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.certified.peer import Lists, Peer
from companion.avoidance.certified.peer_plans import PlanFile, StoredPlan, read, stored
from companion.config.certified import CertifiedConfig
from companion.errors import CompanionError
from companion.values.horizon import Array
from companion.values.refused_senders import RefusedSenders
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import WirePlan

_OLDEST, _AHEAD = 12, 4
"""Largest time (epochs) by which a received plan may begin before now, and after."""
_REPORTED_US = 5_000_000
"""Time (µs) after a message of another fleet, or of a wrong clock, during which its sender is reported.

In this time no statement of a sender of another fleet is accepted, and no plan, unless it is expected.
"""
_HEARD_US = 5_000_000
"""Time (µs) after the last plan or statement of a peer during which its lost plans are counted."""


class Agreements:
    """Agreements of the vehicle ``own`` (system id) in a ``fleet``.

    ``beyond``: test whether a plan, at a time (µs), shows that its vehicle is beyond the range; None: there
    is no range. With a range, peers are those that were last heard within it, the expected ones and those
    that others name are none, and those that were heard beyond it are kept apart (``distant``): they cost
    nothing.
    ``steps``: number of knots of every plan. ``since``: epoch (µs) of the first plan since which each own
    plan began on the one before; it changes when the vehicle returns, not at its farewell. ``refused`` counts
    the messages that were not accepted.
    """

    def __init__(
        self,
        own: int,
        config: CertifiedConfig,
        steps: int,
        fleet: FleetIdentity,
        geometry: Geometry,
        beyond: Callable[[int, StoredPlan], bool] | None = None,
    ) -> None:
        self.own = own
        self._config, self._steps, self._fleet = config, steps, fleet
        self._plans = PlanFile()
        self._negotiation = Negotiation(self._plans, steps, geometry)
        self._beyond = beyond
        expected = set(config.fleet) - {own} if beyond is None else ()
        self._peers = {system: Peer(own, system) for system in expected}
        self._distant: dict[int, Peer] = {}
        self._members: frozenset[int] | None = None
        self._foreign: dict[int, int] = {}
        self._other_knots: dict[int, int] = {}
        self._differing: dict[int, int] = {}
        self._early: dict[int, int] = {}
        self._farewell: int | None = None
        self._before: dict[int, Lists] | None = None
        """What ``recall`` returns to: the lists of before the newest plan, until the next message."""
        self.since = self.refused = 0

    def receive_plan(self, now: int, system: int, payload: bytes) -> None:
        """Receive a TUNNEL payload of kind plan.

        Refuses and counts a plan that cannot be decoded, does not end at rest, differs from this vehicle's
        settings (frame, dt, steps, epoch), is too far from ``now``, or differs from the stored plan of its
        epoch.
        """
        self._before = None
        peer = self._heard(system)
        if peer is not None and peer.last_payload == payload:
            # Most payloads repeat the last one.
            peer.last_received = now
            self._place(now, peer)
            return
        if system == self.own:
            return
        try:
            plan, at_rest = read(payload)
        except PlanWireError:
            self.refused += 1
            return
        if not (at_rest and self._fits(now, system, plan.plan)) or self._unknown_differs(now, system):
            self.refused += 1
            return
        peer = self._known(system)
        departed = peer.left is not None
        if peer.receive_plan(now, plan):
            peer.last_payload = payload
            if departed and peer.left is None:
                self._members = None
            self._place(now, peer)
        else:
            self.refused += 1

    def _place(self, now: int, peer: Peer) -> None:
        """Count a ``peer`` that was heard, unless its plan shows that it is beyond the range.

        That is its plan of the present epoch, or of its last beginning if that comes later, or else its
        newest one: after an older plan it may have been flown by another controller. Plans of before it began
        anew show nothing.
        """
        if self._beyond is None:
            return
        system, plans = peer.pair.peer, peer.plans
        plan = plans.get(max(now - now % self._config.epoch_us, peer.begun)) or plans.newest
        if plan is not None and plan.plan.epoch >= peer.begun and self._beyond(now, plan):
            if system in self._peers:
                peer.part()
                self._distant[system] = self._peers.pop(system)
                self._members = None
        elif system in self._distant:
            peer.meet()
            self._peers[system] = self._distant.pop(system)
            self._members = None

    def _fits(self, now: int, system: int, plan: WirePlan) -> bool:
        """Return whether a plan is in the fleet's frame, on its knots, and of about ``now`` (µs)."""
        epoch = self._config.epoch_us
        if plan.origin != self._fleet.origin:
            self._foreign[system] = now
            return False
        if plan.dt != self._config.dt_us or len(plan.accelerations) != self._steps or plan.epoch % epoch:
            self._other_knots[system] = now
            return False
        return -_OLDEST * epoch <= plan.epoch - now and self._begun(now, system, plan.epoch)

    def _begun(self, now: int, system: int, epoch: int) -> bool:
        """Return whether a sender whose clock is right can have sent this ``epoch`` (µs) by now."""
        if epoch - now <= _AHEAD * self._config.epoch_us:
            return True
        self._early[system] = now
        return False

    def receive_statement(self, now: int, system: int, statement: Statement) -> None:
        """Receive a statement of ``system``; refuse one of another fleet, or of a clock that is ahead."""
        self._before = None
        if system == self.own:
            return
        if statement.fingerprint != self.fingerprint:
            self._refuse_fleet(now, system)
        elif not self._begun(now, system, max(statement.epoch, statement.since)):
            self.refused += 1
        else:
            peer = self._known(system)
            if peer.receive(now, statement, self.since if self._farewell is None else 0):
                self._members = None
            self._place(now, peer)

    def _refuse_fleet(self, now: int, system: int) -> None:
        """Refuse a statement of another fleet.

        Its sender is no member, unless it is expected. If statements of this fleet were received from the id
        as well, two vehicles have it, or its companion has begun again with other settings.
        """
        self.refused += 1
        self._differing[system] = now
        peer = self._heard(system)
        if peer is None:
            return
        if peer.stated:
            peer.contradict(now)
        elif system not in self._config.fleet:
            self._peers.pop(system, None)
            self._distant.pop(system, None)
            self._members = None

    def _unknown_differs(self, now: int, system: int) -> bool:
        """Return whether ``system`` is no peer, and has lately sent a statement of another fleet."""
        return self._heard(system) is None and system in _recent(self._differing, now)

    def _heard(self, system: int) -> Peer | None:
        """Return the peer ``system``, or the one that was heard beyond the range; None for another one."""
        return self._peers.get(system) or self._distant.get(system)

    def _everybody(self) -> Iterator[Peer]:
        """Yield the peers, and those that were heard beyond the range."""
        yield from self._peers.values()
        yield from self._distant.values()

    def _known(self, system: int) -> Peer:
        peer = self._heard(system)
        if peer is None:
            peer = self._peers[system] = Peer(self.own, system, parts=self._beyond is not None)
            self._members = None
            if self._beyond is not None:
                peer.meet()
        return peer

    def begin(self, since: int) -> None:
        """Discard all agreements: the own plan of ``since`` (µs) does not begin on the one before."""
        self.since, self._farewell, self._before = since, None, None
        self._plans.clear()
        for peer in self._everybody():
            peer.begin()

    def leave(self, epoch: int) -> None:
        """Discard all agreements, and the others' farewells, at the own farewell with the plan of ``epoch``.

        What others do until the own return may not be received, so each of them must be heard anew then.
        """
        self._farewell, self._members, self._before = epoch, None, None
        for peer in self._everybody():
            peer.leave(epoch)

    def rejoin(self) -> bool:
        """Begin anew with the first plan after the own farewell; return False without a farewell."""
        if self._farewell is None:
            return False
        self.since, self._farewell = self._farewell + self._config.epoch_us, None
        self._before = None
        for peer in self._everybody():
            peer.begin()
        return True

    def made(self, plan: WirePlan) -> bool:
        """File the own newest plan, which keeps all agreements of the lists; return whether it is new."""
        newest = self._plans.newest
        if newest is not None and newest.plan is plan:
            return False
        self._before = {system: peer.lists() for system, peer in self._peers.items()}
        self._plans.add(stored(plan), {epoch for peer in self._peers.values() for epoch in peer.needed()})
        return True

    def recall(self, epoch: int) -> bool:
        """Discard the own plan of ``epoch`` (µs), the newest, and undo what was agreed since it was filed.

        Nothing of this was sent, and what was taken since may rely on this plan. Returns False, and changes
        nothing, if anything was received since, or the vehicle has begun anew or said farewell.
        """
        newest, before = self._plans.newest, self._before
        if before is None or newest is None or newest.plan.epoch != epoch:
            return False
        self._plans.remove(epoch)
        self._before = None
        for system, lists in before.items():
            self._peers[system].undo(lists)
        return True

    def update(self, now: int) -> None:
        """Take, propose and refuse agreements, with the own newest plan."""
        newest = self._plans.newest
        if newest is None or newest.plan.epoch < self.since or self._farewell is not None:
            return
        for peer in self._peers.values():
            settled = peer.settled is newest and now <= peer.settled_until
            if settled or peer.left is not None or peer.doubted(now):
                continue
            if peer.stated and peer.plans.newest is not None:
                self._negotiation.advance(now, peer, newest, self.since)

    @property
    def fingerprint(self) -> int:
        """Fingerprint (32 bits) of the settings that the fleet has in common."""
        return self._fleet.fingerprint

    @property
    def members(self) -> frozenset[int]:
        """System ids of the peers that need an agreement: all known ones that have not said farewell."""
        if self._members is None:
            known = set(self._peers)
            for peer in self._peers.values() if self._beyond is None else ():
                known.update(system for system, departed in peer.names.items() if not departed)
            self._members = frozenset(known).difference((self.own,), self.left)
        return self._members

    @property
    def left(self) -> dict[int, StoredPlan]:
        """Last plans of the vehicles that said farewell, by system id, also of those beyond the range.

        They stay there, and may be silent when this vehicle comes.
        """
        known = [*self._peers.values(), *self._distant.values()]
        return {peer.pair.peer: peer.left for peer in known if peer.left is not None}

    @property
    def distant(self) -> dict[int, int]:
        """Vehicles that fly plans beyond the range, and when (µs) the last plan or statement of each came.

        Those that said farewell, or that another controller flies, are not among them.
        """
        return {
            system: peer.last_received
            for system, peer in self._distant.items()
            if peer.last_received is not None and peer.left is None and not peer.away
        }

    def received(self, now: int, count: int) -> float | None:
        """Return the share of the last ``count`` epochs of which a plan arrived, at ``now`` (µs).

        It is the mean over the peers that were heard lately, without departed ones and those that
        another controller flies. None without such a peer, or if all are known for less time.
        """
        epoch = self._config.epoch_us
        known = (peer.plans.share(epoch, count) for peer in self._lately(now, _HEARD_US))
        shares = [share for share in known if share is not None]
        return sum(shares) / len(shares) if shares else None

    def _lately(self, now: int, within: int) -> Iterator[Peer]:
        """Yield the peers of which a plan or statement was received ``within`` this time (µs) before ``now``.

        Departed ones and those that another controller flies are not among them.
        """
        for peer in self._peers.values():
            last = peer.last_received
            if peer.left is None and not peer.away and last is not None and now - last <= within:
                yield peer

    @property
    def away(self) -> frozenset[int]:
        """Members whose vehicle another controller flies, which need not keep the agreements."""
        return frozenset([system for system, peer in self._peers.items() if peer.away and peer.left is None])

    def resting(self, since: int, within: float) -> dict[int, Array]:
        """Return where the newest plan of each peer ends (3,), m, whose plan of ``since`` (µs) was there.

        That is ``within`` this distance (m).
        """
        found = {}
        for system, peer in self._peers.items():
            newest, then = peer.plans.newest, peer.plans.before(since)
            if newest is not None and then is not None:
                end = newest.controls[-1, 2]
                if np.abs(end - horizon_of(then.plan).at(since).position).max() <= within:
                    found[system] = end
        return found

    def newest(self) -> dict[int, StoredPlan]:
        """Return the newest plan of each peer that has not said farewell, in the order of the peers."""
        known = ((s, peer.plans.newest) for s, peer in self._peers.items() if peer.left is None)
        return {system: plan for system, plan in known if plan is not None}

    def ends(self) -> dict[int, Array]:
        """Return where the newest plan of each peer that has not said farewell ends (3,), m, by system id."""
        return {system: plan.controls[-1, 2] for system, plan in self.newest().items()}

    @property
    def columns(self) -> frozenset[int]:
        """Systems whose newest plan is a column, without those that said farewell: they make no other."""
        return frozenset(system for system, plan in self.newest().items() if plan.plan.column)

    @property
    def outside(self) -> float:
        """Largest distance (m) by which a member has left its tube, by its newest statement."""
        return max((peer.outside for peer in self._peers.values() if peer.left is None), default=0.0)

    def kept(self) -> dict[int, tuple[Agreement, ...]]:
        """Return the agreements that the own plans keep, by system id, without those of departed vehicles."""
        return {system: peer.pair.kept for system, peer in self._peers.items() if peer.left is None}

    def age(self, now: int, systems: Iterable[int]) -> float:
        """Return the mean age (s), at ``now`` (µs), of the plans on which room beside ``systems`` rests.

        Of a vehicle that is the oldest plan in an agreement that is kept; without any it does not count.
        Agreements of vehicles that rest are not renewed, so at the beginning of a flight they are old.
        """
        kept = self.kept()
        oldest = [min(map(min, kept[system])) for system in systems if kept.get(system)]
        return 1e-6 * (now - sum(oldest) / len(oldest)) if oldest else 0.0

    def missing(self) -> set[int]:
        """Return the members without an agreement that both vehicles state."""
        peers = ((system, self._peers.get(system)) for system in self.members)
        return {system for system, peer in peers if peer is None or peer.pair.confirmed is None}

    def unreserved(self) -> set[int]:
        """Return the vehicles beside which the own newest plan, a column, is not reserved.

        They are the members without an agreement on an own column that both state, those with which another
        agreement is still kept, and departed ones whose last plan is too near.
        """
        return self.missing() | self._in_space() | self.near(self.left)

    def on_columns(self) -> bool:
        """Return whether all agreements that are kept are on own columns, so that all planes are upright."""
        return not self._in_space()

    def _in_space(self) -> set[int]:
        """Return the vehicles with which an agreement is kept that is not on an own column."""
        return {
            system
            for system, peer in self._peers.items()
            if peer.left is None and not all(self._on_column(one) for one in peer.pair.kept)
        }

    def _on_column(self, one: Agreement) -> bool:
        own = self._plans.get(one.own)
        return own is not None and own.plan.column

    def near(self, plans: dict[int, StoredPlan] | None = None, column: WirePlan | None = None) -> set[int]:
        """Return the systems of which one of the ``plans`` is too near for an agreement with a ``column``.

        Without ``column``: that of the own newest plan. Without ``plans``: the newest that are known.
        """
        newest = self._plans.newest if column is None else stored(column)
        if plans is None:
            known = {system: peer.left or peer.plans.newest for system, peer in self._peers.items()}
            plans = {system: plan for system, plan in known.items() if plan is not None}
        if newest is None:
            return set()
        own = newest._replace(plan=newest.plan._replace(column=True))
        return {system for system, plan in plans.items() if not self._negotiation.clear(own, plan)}

    def clear(self, systems: set[int]) -> bool:
        """Return whether the newest plans of ``systems`` are known, and far enough from the own column."""
        known = {system: peer.plans.newest for system, peer in self._peers.items() if system in systems}
        plans = {system: plan for system, plan in known.items() if plan is not None}
        return plans.keys() == systems and not self.near(plans)

    def outdated(self, now: int, epoch: int) -> bool:
        """Return whether an agreement on the plans of ``epoch`` (µs) may soon replace an older one.

        Vehicles that another controller flies, and those from which nothing was received for ``gone_us``, are
        not counted.
        """
        lately = self._lately(now, self._config.gone_us)
        return any(not self._negotiation.current(peer, epoch) for peer in lately)

    def agreed(self) -> list[AgreedPlanes]:
        """Return the planes of all agreements that are kept, in the order of system ids.

        Raises CompanionError if those of one are missing.
        """
        found = []
        for system, peer in sorted(self._peers.items()):
            for one in peer.pair.kept:
                planes = peer.agreed.get(one)
                if planes is None:
                    raise CompanionError(f"the planes of the agreement {one} with {system} are not filed")
                found.append(planes)
        return found

    def unanswered(self) -> list[WirePlan]:
        """Return the own plans of proposals without an answer, the oldest first, without the newest plan.

        A peer needs the plan to take the proposal, and may not have received it.
        """
        epochs = {one.own for peer in self._peers.values() if peer.left is None for one in peer.pair.open}
        found = [self._plans.get(epoch) for epoch in sorted(epochs)]
        return [one.plan for one in found if one is not None and one is not self._plans.newest]

    @property
    def changed(self) -> bool:
        """Whether an entry has changed since it was last stated."""
        return any(peer.changed for peer in self._stated())

    def entries(self, *, every: bool) -> tuple[Entry, ...]:
        """Return the entries to state, ``every`` one or those that changed, and count them as stated."""
        found = [peer.entry() for peer in self._stated() if every or peer.changed]
        if every:
            found += [Entry(system) for system in sorted(self.members - self._peers.keys())]
        return tuple(found)

    def _stated(self) -> list[Peer]:
        """Return the peers to state, by system id.

        They are the expected ones and those that have the fleet's fingerprint. One of which only plans were
        received may be of another fleet, and receivers of its name would wait for it. With a range nobody
        does: all are stated.
        """
        known = sorted(self._peers.items())
        if self._beyond is not None:
            return [peer for _, peer in known]
        return [peer for system, peer in known if peer.stated or system in self._config.fleet]

    def refused_senders(self, now: int) -> RefusedSenders:
        """Return the senders whose plans are refused at ``now`` (µs)."""
        foreign = _recent(self._foreign, now)
        differing = (_recent(self._differing, now) | _recent(self._other_knots, now)) - foreign
        doubled = {peer.pair.peer for peer in self._everybody() if peer.doubted(now)} - foreign - differing
        early = _recent(self._early, now)
        return RefusedSenders(*(tuple(sorted(found)) for found in (doubled, foreign, differing, early)))


def _recent(times: dict[int, int], now: int) -> set[int]:
    """Return the systems whose time is less than ``_REPORTED_US`` before ``now`` (µs)."""
    return {system for system, time in times.items() if now - time < _REPORTED_US}
