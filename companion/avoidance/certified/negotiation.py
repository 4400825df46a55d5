"""Negotiation of agreements with one peer: what is taken, what is proposed, and what is refused.

Both vehicles of a pair propose the same agreement, on their plans of one epoch, each as soon as it holds both
plans. So the proposal of the peer is the answer to the own one, and an agreement is known to be taken after
two delays of a message: one of the plan, and one of the proposal. Where messages are late, the newest own
plan is later than that of the agreement, and must keep it. Where messages are lost they may propose different
ones: the newer one counts, or both are refused. If they have no epoch in common for some time, as where both
miss epochs on busy machines, the vehicle with the lower id proposes the newest plans.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from companion.avoidance.certified.agreed_planes import AgreedPlanes, Rows, made, stacked
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.certified.peer import Peer
from companion.avoidance.certified.peer_plans import PlanFile, StoredPlan
from companion.avoidance.certified.separating_planes import SHARE, keeps
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import WirePlan

_MOST_KEPT = 5
"""Number of agreements of a pair with which nothing is proposed any more."""
_OVERDUE = 0.5
"""Round trips after which an unanswered proposal is followed by another."""

_OTHER_SHARE = 0.05
"""Difference of shares of the room from which on the planes of two agreements are not the same."""

_LATE_US = 2_000_000
"""Age (µs) from which on a plan of an offer that has not been received is not expected any more."""

_CLEAR = 256
"""Number of results of ``Negotiation.clear`` that are kept."""


class Geometry(NamedTuple):
    """Tests of plans, which are control points (n + 1, 3, 3), m, on the same knots.

    ``apart``: whether two plans are the least distance apart. ``agreed``: what the planes of a pair of
    plans are made of. Both take the number of columns among the pair of plans, see ``columns.Distances``.
    """

    apart: Callable[[Array, Array, int], bool]
    agreed: Rows


class AgreedPlans(NamedTuple):
    """The two plans of an agreement: the own one and the peer's."""

    own: StoredPlan
    other: StoredPlan

    @property
    def columns(self) -> int:
        """Number of columns among the two plans."""
        return self.own.plan.column + self.other.plan.column


class Negotiation:
    """Negotiation of one vehicle with each of its peers; ``plans``: its own, of ``steps`` knots each."""

    def __init__(self, plans: PlanFile, steps: int, geometry: Geometry) -> None:
        self._plans, self._steps, self._geometry = plans, steps, geometry
        self._clear: dict[tuple[WirePlan, WirePlan], bool] = {}

    def advance(self, now: int, peer: Peer, newest: StoredPlan, since: int) -> None:
        """Take an offer of ``peer`` that the ``newest`` own plan keeps, or propose or refuse one.

        Offers on own plans of before ``since`` (µs) are void. If nothing was taken, refused or acknowledged,
        the peer is ``settled``: there is nothing to do until its next message, until the next own plan, or
        until a proposal has waited too long for an answer.
        """
        pair, epoch = peer.pair, newest.plan.epoch
        before = pair.kept, pair.considered
        peer.contradicted &= pair.confirmed is None
        refused = None
        for one in pair.offers:
            if one.epoch > epoch or one.own < since or not pair.may_take(one):
                continue
            plans = self.plans_of(peer, one)
            if plans is None:
                if epoch - min(one) > _LATE_US:
                    refused = refused or one
                continue
            planes = self._planes(peer, plans)
            if self._taken_in_time(newest, planes) and self._unambiguous(peer, plans, one.epoch):
                peer.agree(one, planes)
                break
            refused = refused or one
        other, common = peer.plans.before(epoch), self._proposable(peer, newest, since)
        proposed = None if common is None else self._worthwhile(now, peer, newest, common)
        if proposed is not None:
            peer.propose(now, Agreement(proposed.own.plan.epoch, proposed.other.plan.epoch), proposed)
        elif refused is not None and pair.newer(refused, pair.considered):
            pair.refuse(refused)
            peer.changed = True
        elif other is not None and not pair.kept and pair.acknowledge(other.plan.epoch):
            # If this vehicle ends before there is an agreement, its farewell answers the peer all the same.
            peer.changed = True
        if (pair.kept, pair.considered) == before:
            # A proposal that waits for an answer is followed by another one after a time: nothing else waits.
            waiting, patience = peer.waiting(now), _OVERDUE * peer.round_trip
            left = inf if waiting is None or waiting > patience else patience - waiting
            peer.settled, peer.settled_until = newest, now + left

    def _proposable(self, peer: Peer, newest: StoredPlan, since: int) -> AgreedPlans | None:
        """Return the plans on which an agreement may be proposed; None without any.

        They are those of the last epoch of which both are filed, not before ``since`` (µs). If newer plans of
        the peer have come for ``_LATE_US`` without one, they are the ``newest`` of both, for the lower id.
        """
        epoch = newest.plan.epoch
        last = other = peer.plans.before(epoch)
        while other is not None and other.plan.epoch >= since:
            own = self._plans.get(other.plan.epoch)
            if own is not None:
                break
            other = peer.plans.before(other.plan.epoch - 1)
        else:
            own = other = None
        if last is None:
            return None
        known = since if other is None else other.plan.epoch
        if peer.pair.leads and last.plan.epoch - known > _LATE_US:
            return AgreedPlans(newest, last)
        return None if own is None or other is None else AgreedPlans(own, other)

    def plans_of(self, peer: Peer, one: Agreement) -> AgreedPlans | None:
        """Return the two plans of an agreement; None if one is not filed."""
        own, other = self._plans.get(one.own), peer.plans.get(one.other)
        return None if own is None or other is None else AgreedPlans(own, other)

    def _planes(self, peer: Peer, plans: AgreedPlans) -> AgreedPlanes:
        """Return the planes of an agreement on these ``plans``: those that ``peer`` holds, or new ones."""
        known = peer.agreed.get(Agreement(plans.own.plan.epoch, plans.other.plan.epoch))
        if known is not None and known.own is plans.own and known.other is plans.other:
            return known
        return made(*plans, self._geometry.agreed)

    def current(self, peer: Peer, epoch: int) -> bool:
        """Return whether the only agreement is as good as one on the plans of ``epoch`` (µs)."""
        if len(peer.pair.kept) != 1:
            return False
        if peer.pair.kept[0] == (epoch, epoch):
            return True
        agreed, newest = self.plans_of(peer, peer.pair.kept[0]), self.plans_of(peer, Agreement(epoch, epoch))
        return agreed is not None and newest is not None and self._same(peer, agreed, newest)

    def _worthwhile(
        self, now: int, peer: Peer, newest: StoredPlan, plans: AgreedPlans
    ) -> AgreedPlanes | None:
        """Return the planes of an agreement on these ``plans`` if it is to be proposed, or None.

        The ``newest`` own plan must keep it, as where it is taken.
        """
        pair = peer.pair
        one = Agreement(plans.own.plan.epoch, plans.other.plan.epoch)
        if not pair.may_take(one) or len(pair.kept) >= _MOST_KEPT:
            return None
        if any(kept.epoch > one.epoch for kept in pair.kept):
            # The planes of an agreement say nothing of times before its later plan.
            return None
        if pair.kept:
            last = self.plans_of(peer, pair.kept[-1])
            if last is not None and self._same(peer, last, plans):
                return None
        waiting = peer.waiting(now)
        if waiting is not None and waiting <= _OVERDUE * peer.round_trip:
            return None
        if not (self._apart(peer, plans) and self._reservable(newest, plans)):
            return None
        planes = self._planes(peer, plans)
        # A plan keeps the agreements that it is part of.
        return planes if plans.own is newest or self._taken_in_time(newest, planes) else None

    def _reservable(self, newest: StoredPlan, plans: AgreedPlans) -> bool:
        """Return whether columns permit an agreement on these plans.

        The two must be apart horizontally, because planes between nearer ones would keep only their distance.
        And a vehicle whose ``newest`` plan is a column agrees on no plan in space that it made before.
        """
        if newest.plan.column and not plans.own.plan.column:
            return False
        return not plans.columns or self.clear(*plans)

    def clear(self, one: StoredPlan, other: StoredPlan) -> bool:
        """Return whether two plans are the least distance apart from the beginning of the later one on."""
        names = one.plan, other.plan
        known = self._clear.get(names)
        if known is None:
            epoch, rows = max(one.plan.epoch, other.plan.epoch), self._steps + 1
            columns = one.plan.column + other.plan.column
            known = self._geometry.apart(one.later(epoch, rows), other.later(epoch, rows), columns)
            if len(self._clear) >= _CLEAR:
                self._clear.clear()
            self._clear[names] = known
        return known

    def _taken_in_time(self, newest: StoredPlan, planes: AgreedPlanes) -> bool:
        """Return whether the ``newest`` own plan, and the one flown until it begins, keep an agreement.

        The peer may replan on this agreement alone, and by a clock that is behind.
        """
        epoch = newest.plan.epoch
        if not (
            self._kept(newest, planes, epoch)
            and self._reservable(newest, AgreedPlans(planes.own, planes.other))
        ):
            return False
        flown = self._plans.before(epoch - 1)
        begins = epoch if flown is None else max(flown.plan.epoch, planes.epoch)
        return flown is None or begins >= epoch or self._kept(flown, planes, begins)

    def _apart(self, peer: Peer, plans: AgreedPlans) -> bool:
        """Return whether two plans are as far apart as the confirmed agreement demands.

        A plan that either made before it took that agreement may not keep it, and planes between two near
        plans would keep only their distance.
        """
        confirmed = peer.pair.confirmed
        epoch = plans.own.plan.epoch
        if confirmed is None:
            return self._unambiguous(peer, plans, epoch)
        before = self.plans_of(peer, confirmed)
        if before is None:
            return False
        if plans.own is not self._plans.newest and not self._kept(
            plans.own, self._planes(peer, before), epoch
        ):
            return False
        return self._kept(plans.other, made(before.other, before.own, self._geometry.agreed), epoch)

    def _unambiguous(self, peer: Peer, plans: AgreedPlans, epoch: int) -> bool:
        """Return whether two plans may be the first ones agreed on.

        They always may, unless the peer has contradicted itself, or was met within the range.

        Then nothing is known of the peer's plan but the plan itself: it must be the least distance from the
        own one from ``epoch`` (µs) on.
        """
        if not peer.contradicted:
            return True
        rows = self._steps + 1
        return self._geometry.apart(
            plans.own.later(epoch, rows), plans.other.later(epoch, rows), plans.columns
        )

    def _same(self, peer: Peer, before: AgreedPlans, after: AgreedPlans) -> bool:
        """Return whether both plans of an agreement are the earlier ones, carried on, and share the room so.

        Plans that have come to rest since then share it equally, whereas the one that flew behind had more.
        """
        epoch = max(after.own.plan.epoch, after.other.plan.epoch)
        carried_on = all(
            one is two
            or (
                one.plan.column == two.plan.column
                and bool((one.later(epoch, self._steps) == two.later(epoch, self._steps)).all())
            )
            for one, two in zip(before, after, strict=True)
        )
        if not carried_on or all(one.still for one in before):
            # Hovering vehicles come here in each step: their planes are not computed anew.
            return carried_on
        rows = stacked(
            [self._planes(peer, plans) for plans in (before, after)],
            epoch,
            after.own.plan.dt,
            self._steps,
        )
        return float(abs(rows[0, :, SHARE] - rows[1, :, SHARE]).max()) <= _OTHER_SHARE

    def _kept(self, plan: StoredPlan, planes: AgreedPlanes, epoch: int) -> bool:
        """Return whether ``plan`` keeps the planes of an agreement from ``epoch`` (µs) on, for ever.

        ``planes``: those of the vehicle of ``plan``. None of the plans begins later than ``epoch``, so all
        rest in the last of the n + 1 segments.
        """
        rows = stacked([planes], epoch, plan.plan.dt, self._steps)
        return keeps(plan.later(epoch, self._steps + 1), rows[0])
