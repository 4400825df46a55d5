"""Agreements of a vehicle with all its peers: what was received, and what its plans must keep.

A vehicle replans only if it and each member have an agreement that both state (``missing`` is empty). Members
are the expected vehicles, the senders of plans and statements, and the vehicles that these name, all until
their farewell. A vehicle that said farewell flies its last plan to the end and stays there; it needs no
agreement before it has begun anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from companion.avoidance.certified.agreed_planes import AgreedPlanes
from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.avoidance.certified.negotiation import Geometry, Negotiation
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.certified.peer import Lists
from companion.avoidance.certified.peer_plans import PlanFile, StoredPlan, read, stored
from companion.avoidance.certified.peers import Peers
from companion.avoidance.certified.sender_checks import SenderChecks
from companion.config.certified import CertifiedConfig
from companion.errors import CompanionError
from companion.values.refused_senders import RefusedSenders
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import WirePlan


class Agreements:
    """Agreements of the vehicle ``own`` (system id) in a ``fleet``.

    ``plans``: the own plans. ``steps``: number of knots of every plan. ``beyond``: see ``Peers``. ``since``:
    epoch (µs) of the first plan since which each own plan began on the one before; it changes when the
    vehicle returns, not at its farewell. ``refused`` counts the messages that were not accepted.
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
        self.peers = Peers(own, config, beyond)
        self._config, self._fleet = config, fleet
        self.plans = PlanFile()
        self.negotiation = Negotiation(self.plans, steps, geometry)
        self._checks = SenderChecks(config, steps, fleet)
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
        peer = self.peers.heard(system)
        if peer is not None and peer.last_payload == payload:
            # Most payloads repeat the last one.
            peer.last_received = now
            self.peers.place(now, peer)
            return
        if system == self.own:
            return
        try:
            plan, at_rest = read(payload)
        except PlanWireError:
            self.refused += 1
            return
        fits = at_rest and self._checks.fits(now, system, plan.plan)
        if not fits or (peer is None and self._checks.differs(now, system)):
            self.refused += 1
            return
        peer = self.peers.known(system)
        departed = peer.left is not None
        if peer.receive_plan(now, plan):
            peer.last_payload = payload
            if departed and peer.left is None:
                self.peers.change_members()
            self.peers.place(now, peer)
        else:
            self.refused += 1

    def receive_statement(self, now: int, system: int, statement: Statement) -> None:
        """Receive a statement of ``system``; refuse one of another fleet, or of a clock that is ahead."""
        self._before = None
        if system == self.own:
            return
        if not self._checks.same_fleet(now, system, statement):
            self._refuse_fleet(now, system)
        elif not self._checks.begun(now, system, statement):
            self.refused += 1
        else:
            peer = self.peers.known(system)
            if peer.receive(now, statement, self.since if self._farewell is None else 0):
                self.peers.change_members()
            self.peers.place(now, peer)

    def _refuse_fleet(self, now: int, system: int) -> None:
        """Refuse a statement of another fleet.

        Its sender is no member, unless it is expected. If statements of this fleet were received from the id
        as well, two vehicles have it, or its companion has begun again with other settings.
        """
        self.refused += 1
        peer = self.peers.heard(system)
        if peer is None:
            return
        if peer.stated:
            peer.contradict(now)
        elif system not in self._config.fleet:
            self.peers.discard(system)

    def begin(self, since: int) -> None:
        """Discard all agreements: the own plan of ``since`` (µs) does not begin on the one before."""
        self.since, self._farewell, self._before = since, None, None
        self.plans.clear()
        for peer in self.peers.everybody():
            peer.begin()

    def leave(self, epoch: int) -> None:
        """Discard all agreements, and the others' farewells, at the own farewell with the plan of ``epoch``.

        What others do until the own return may not be received, so each of them must be heard anew then.
        """
        self._farewell, self._before = epoch, None
        self.peers.change_members()
        for peer in self.peers.everybody():
            peer.leave(epoch)

    def rejoin(self) -> bool:
        """Begin anew with the first plan after the own farewell; return False without a farewell."""
        if self._farewell is None:
            return False
        self.since, self._farewell = self._farewell + self._config.epoch_us, None
        self._before = None
        for peer in self.peers.everybody():
            peer.begin()
        return True

    def made(self, plan: WirePlan) -> bool:
        """File the own newest plan, which keeps all agreements of the lists; return whether it is new."""
        newest = self.plans.newest
        if newest is not None and newest.plan is plan:
            return False
        self._before = {system: peer.lists() for system, peer in self.peers.counted.items()}
        self.plans.add(
            stored(plan), {epoch for peer in self.peers.counted.values() for epoch in peer.needed()}
        )
        return True

    def recall(self, epoch: int) -> bool:
        """Discard the own plan of ``epoch`` (µs), the newest, and undo what was agreed since it was filed.

        Nothing of this was sent, and what was taken since may rely on this plan. Returns False, and changes
        nothing, if anything was received since, or the vehicle has begun anew or said farewell.
        """
        newest, before = self.plans.newest, self._before
        if before is None or newest is None or newest.plan.epoch != epoch:
            return False
        self.plans.remove(epoch)
        self._before = None
        for system, lists in before.items():
            self.peers.counted[system].undo(lists)
        return True

    def update(self, now: int) -> None:
        """Take, propose and refuse agreements, with the own newest plan."""
        newest = self.plans.newest
        if newest is None or newest.plan.epoch < self.since or self._farewell is not None:
            return
        for _, peer in self.peers.present():
            settled = peer.settled is newest and now <= peer.settled_until
            if settled or peer.doubted(now):
                continue
            if peer.stated and peer.plans.newest is not None:
                self.negotiation.advance(now, peer, newest, self.since)

    @property
    def fingerprint(self) -> int:
        """Fingerprint (32 bits) of the settings that the fleet has in common."""
        return self._fleet.fingerprint

    def kept(self) -> dict[int, tuple[Agreement, ...]]:
        """Return the agreements that the own plans keep, by system id, without those of departed vehicles."""
        return {system: peer.pair.kept for system, peer in self.peers.present()}

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
        peers = ((system, self.peers.counted.get(system)) for system in self.peers.members)
        return {system for system, peer in peers if peer is None or peer.pair.confirmed is None}

    def outdated(self, now: int, epoch: int) -> bool:
        """Return whether an agreement on the plans of ``epoch`` (µs) may soon replace an older one.

        Vehicles that another controller flies, and those from which nothing was received for ``gone_us``, are
        not counted.
        """
        lately = self.peers.lately(now, self._config.gone_us)
        return any(not self.negotiation.current(peer, epoch) for peer in lately)

    def agreed(self) -> list[AgreedPlanes]:
        """Return the planes of all agreements that are kept, in the order of system ids.

        Raises CompanionError if those of one are missing.
        """
        found = []
        for system, peer in sorted(self.peers.counted.items()):
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
        epochs = {one.own for _, peer in self.peers.present() for one in peer.pair.open}
        found = [self.plans.get(epoch) for epoch in sorted(epochs)]
        return [one.plan for one in found if one is not None and one is not self.plans.newest]

    @property
    def changed(self) -> bool:
        """Whether an entry has changed since it was last stated."""
        return any(peer.changed for peer in self.peers.stated())

    def entries(self, *, every: bool) -> tuple[Entry, ...]:
        """Return the entries to state, ``every`` one or those that changed, and count them as stated."""
        found = [peer.entry() for peer in self.peers.stated() if every or peer.changed]
        if every:
            found += [Entry(system) for system in sorted(self.peers.members - self.peers.counted.keys())]
        return tuple(found)

    def refused_senders(self, now: int) -> RefusedSenders:
        """Return the senders whose plans are refused at ``now`` (µs)."""
        doubted = [peer.pair.peer for peer in self.peers.everybody() if peer.doubted(now)]
        return self._checks.refused_senders(now, doubted)
