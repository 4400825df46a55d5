"""Agreements of a vehicle that takes off or lands: those on its column, and where its column has room."""

from __future__ import annotations

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.certified.peer_plans import StoredPlan, stored
from mavlink_bridge.wire.plan import WirePlan


class ColumnAgreements:
    """Those of a vehicle's ``agreements`` that are on its column, a plan whose heights do not count."""

    def __init__(self, agreements: Agreements) -> None:
        self._agreements, self._peers = agreements, agreements.peers
        self._plans, self._negotiation = agreements.plans, agreements.negotiation

    def unreserved(self) -> set[int]:
        """Return the vehicles beside which the own newest plan, a column, is not reserved.

        They are the members without an agreement on an own column that both state, those with which another
        agreement is still kept, and departed ones whose last plan is too near.
        """
        return self._agreements.missing() | self._in_space() | self.near(self._peers.left)

    def on_columns(self) -> bool:
        """Return whether all agreements that are kept are on own columns, so that all planes are upright."""
        return not self._in_space()

    def _in_space(self) -> set[int]:
        """Return the vehicles with which an agreement is kept that is not on an own column."""
        return {
            system
            for system, peer in self._peers.present()
            if not all(self._on_column(one) for one in peer.pair.kept)
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
            known = {system: peer.left or peer.plans.newest for system, peer in self._peers.counted.items()}
            plans = {system: plan for system, plan in known.items() if plan is not None}
        if newest is None:
            return set()
        own = newest._replace(plan=newest.plan._replace(column=True))
        return {system for system, plan in plans.items() if not self._negotiation.clear(own, plan)}

    def clear(self, systems: set[int]) -> bool:
        """Return whether the newest plans of ``systems`` are known, and far enough from the own column."""
        known = {
            system: peer.plans.newest for system, peer in self._peers.counted.items() if system in systems
        }
        plans = {system: plan for system, plan in known.items() if plan is not None}
        return plans.keys() == systems and not self.near(plans)
