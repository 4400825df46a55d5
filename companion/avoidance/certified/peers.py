"""All peers of a vehicle: which count as members, which are beyond the range, and where their plans lead."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from companion.avoidance.certified.committed import horizon_of
from companion.avoidance.certified.peer import Peer
from companion.avoidance.certified.peer_plans import StoredPlan
from companion.config.certified import CertifiedConfig
from companion.values.horizon import Array

_HEARD_US = 5_000_000
"""Time (µs) after the last plan or statement of a peer during which its lost plans are counted."""


class Peers:
    """Peers of the vehicle ``own`` (system id): those that were heard, and those that are expected.

    ``beyond``: test whether a plan, at a time (µs), shows that its vehicle is beyond the range; None: there
    is no range. With a range, peers that count are those that were last heard within it; the expected ones
    and those that others name do not, and those that were heard beyond it are kept apart (``distant``): they
    cost nothing.
    ``counted``: the peers that count, by system id, also those that said farewell.
    """

    def __init__(
        self, own: int, config: CertifiedConfig, beyond: Callable[[int, StoredPlan], bool] | None
    ) -> None:
        self._own, self._config, self._beyond = own, config, beyond
        expected = set(config.fleet) - {own} if beyond is None else ()
        self.counted = {system: Peer(own, system) for system in expected}
        self._distant: dict[int, Peer] = {}
        self._members: frozenset[int] | None = None

    def heard(self, system: int) -> Peer | None:
        """Return the peer ``system``, or the one that was heard beyond the range; None for another one."""
        return self.counted.get(system) or self._distant.get(system)

    def known(self, system: int) -> Peer:
        """Return the peer ``system``, which counts from now on if it was not heard before."""
        peer = self.heard(system)
        if peer is None:
            peer = self.counted[system] = Peer(self._own, system, parts=self._beyond is not None)
            self.change_members()
            if self._beyond is not None:
                peer.meet()
        return peer

    def everybody(self) -> Iterator[Peer]:
        """Yield the peers that count, and those that were heard beyond the range."""
        yield from self.counted.values()
        yield from self._distant.values()

    def present(self) -> Iterator[tuple[int, Peer]]:
        """Yield the peers that count and have not said farewell, each with its system id."""
        return ((system, peer) for system, peer in self.counted.items() if peer.left is None)

    def place(self, now: int, peer: Peer) -> None:
        """Count a ``peer`` that was heard at ``now`` (µs), unless its plan shows that it is beyond the range.

        That is its plan of the present epoch, or of its last beginning if that comes later, or else its
        newest one: after an older plan it may have been flown by another controller. Plans of before it began
        anew show nothing.
        """
        if self._beyond is None:
            return
        system, plans = peer.pair.peer, peer.plans
        plan = plans.get(max(now - now % self._config.epoch_us, peer.begun)) or plans.newest
        if plan is not None and plan.plan.epoch >= peer.begun and self._beyond(now, plan):
            if system in self.counted:
                peer.part()
                self._distant[system] = self.counted.pop(system)
                self.change_members()
        elif system in self._distant:
            peer.meet()
            self.counted[system] = self._distant.pop(system)
            self.change_members()

    def discard(self, system: int) -> None:
        """Discard all that is known of the peer ``system``."""
        self.counted.pop(system, None)
        self._distant.pop(system, None)
        self.change_members()

    def change_members(self) -> None:
        """Determine the members anew: a peer was added or discarded, or its names or farewell changed."""
        self._members = None

    @property
    def members(self) -> frozenset[int]:
        """System ids of the peers that need an agreement: all known ones that have not said farewell."""
        if self._members is None:
            known = set(self.counted)
            for peer in self.counted.values() if self._beyond is None else ():
                known.update(system for system, departed in peer.names.items() if not departed)
            self._members = frozenset(known).difference((self._own,), self.left)
        return self._members

    @property
    def left(self) -> dict[int, StoredPlan]:
        """Last plans of the vehicles that said farewell, by system id, also of those beyond the range.

        They stay there, and may be silent when this vehicle comes.
        """
        return {peer.pair.peer: peer.left for peer in self.everybody() if peer.left is not None}

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

    @property
    def away(self) -> frozenset[int]:
        """Members whose vehicle another controller flies, which need not keep the agreements."""
        return frozenset([system for system, peer in self.present() if peer.away])

    @property
    def outside(self) -> float:
        """Largest distance (m) by which a member has left its tube, by its newest statement."""
        return max((peer.outside for _, peer in self.present()), default=0.0)

    def lately(self, now: int, within: int) -> Iterator[Peer]:
        """Yield the peers of which a plan or statement was received ``within`` this time (µs) before ``now``.

        Departed ones and those that another controller flies are not among them.
        """
        for _, peer in self.present():
            last = peer.last_received
            if not peer.away and last is not None and now - last <= within:
                yield peer

    def received(self, now: int, count: int) -> float | None:
        """Return the share of the last ``count`` epochs of which a plan arrived, at ``now`` (µs).

        It is the mean over the peers that were heard lately, without departed ones and those that
        another controller flies. None without such a peer, or if all are known for less time.
        """
        epoch = self._config.epoch_us
        known = (peer.plans.share(epoch, count) for peer in self.lately(now, _HEARD_US))
        shares = [share for share in known if share is not None]
        return sum(shares) / len(shares) if shares else None

    def newest(self) -> dict[int, StoredPlan]:
        """Return the newest plan of each peer that has not said farewell, in the order of the peers."""
        known = ((system, peer.plans.newest) for system, peer in self.present())
        return {system: plan for system, plan in known if plan is not None}

    def ends(self) -> dict[int, Array]:
        """Return where the newest plan of each peer that has not said farewell ends (3,), m, by system id."""
        return {system: plan.controls[-1, 2] for system, plan in self.newest().items()}

    @property
    def columns(self) -> frozenset[int]:
        """Systems whose newest plan is a column, without those that said farewell: they make no other."""
        return frozenset(system for system, plan in self.newest().items() if plan.plan.column)

    def resting(self, since: int, within: float) -> dict[int, Array]:
        """Return where the newest plan of each peer ends (3,), m, whose plan of ``since`` (µs) was there.

        That is ``within`` this distance (m).
        """
        found = {}
        for system, peer in self.counted.items():
            newest, then = peer.plans.newest, peer.plans.before(since)
            if newest is not None and then is not None:
                end = newest.controls[-1, 2]
                if np.abs(end - horizon_of(then.plan).at(since).position).max() <= within:
                    found[system] = end
        return found

    def stated(self) -> list[Peer]:
        """Return the peers to state, by system id.

        They are the expected ones and those that have the fleet's fingerprint. One of which only plans were
        received may be of another fleet, and receivers of its name would wait for it. With a range nobody
        does: all are stated.
        """
        known = sorted(self.counted.items())
        if self._beyond is not None:
            return [peer for _, peer in known]
        return [peer for system, peer in known if peer.stated or system in self._config.fleet]
