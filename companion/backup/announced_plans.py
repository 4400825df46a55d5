"""Committed plans that a companion has announced, as its backup node holds them."""

from __future__ import annotations

from companion.avoidance.certified.committed import horizon_of, rests
from companion.flight.plan_feedforward import MAX_PAUSE_US
from companion.values.horizon import Horizon
from mavlink_bridge.wire.plan import WirePlan

AGREES_M = 0.3
"""Largest distance at which a set-point agrees with the plan; it covers the flight during its delay."""
_MAX_EPOCHS_AWAY = 4
"""Largest time, in epochs, between now and the beginning of a plan that is accepted."""


class AnnouncedPlans:
    """Announced plans of one companion; ``origin``: of the fleet frame; ``epoch_us``: length of an epoch.

    ``height``: height (m) of the companion's last set-point, at which a column is flown; None before one.
    """

    def __init__(self, origin: int, epoch_us: int) -> None:
        self._origin, self._epoch_us = origin, epoch_us
        self._plans: dict[int, WirePlan] = {}
        self._cached: tuple[WirePlan, float | None, Horizon] | None = None
        self.height: float | None = None

    def fits(self, now: int, plan: WirePlan) -> bool:
        """Return whether ``plan`` is in the fleet's frame, and of about ``now`` (µs)."""
        return plan.origin == self._origin and abs(plan.epoch - now) <= _MAX_EPOCHS_AWAY * self._epoch_us

    def add(self, now: int, plan: WirePlan) -> bool:
        """Store ``plan``, received at ``now`` (µs), if it fits and ends at rest.

        Returns whether it is earlier than all stored plans, so that it changes ``horizon`` at earlier times.
        """
        if not self.fits(now, plan) or not rests(plan):
            return False
        earlier = bool(self._plans) and plan.epoch < min(self._plans)
        self._plans[plan.epoch] = plan
        # Keep the plan that was flown before the longest pause over which the feed-forward goes on, and those
        # after it.
        begun = [epoch for epoch in self._plans if epoch <= now - MAX_PAUSE_US]
        oldest = max(begun, default=min(self._plans))
        self._plans = {epoch: kept for epoch, kept in self._plans.items() if epoch >= oldest}
        return earlier

    def clear(self) -> None:
        """Discard all plans."""
        self._plans.clear()

    @property
    def newest(self) -> WirePlan | None:
        """The newest plan, whether it has begun or not."""
        return self._plans[max(self._plans)] if self._plans else None

    def horizon(self, now: int) -> Horizon | None:
        """Return the committed plan at ``now`` (µs): the newest that has begun; None without one.

        Before any has begun that is the first one, if it never moves: a companion that begins holds the place
        of its first plan from the announcement on. If plans of before were not received, or were discarded,
        the vehicle may still fly one that ends there; a set-point that agrees is ``AGREES_M`` from the place
        at most. A column whose plan has no vertical motion is at ``height``.
        """
        plan = self._flown(now)
        if plan is None:
            return None
        height = self.height
        if not plan.column or any(a[2] for a in (plan.velocity, *plan.accelerations)):
            height = None
        if self._cached is None or self._cached[0] is not plan or self._cached[1] != height:
            horizon = horizon_of(plan)
            if height is not None:
                horizon.knots[:, 2], horizon.knots[:, 5::3] = height, 0.0
            self._cached = plan, height, horizon
        return self._cached[2]

    def _flown(self, now: int) -> WirePlan | None:
        """Return the newest plan that has begun at ``now`` (µs), or the first one if it never moves."""
        epoch = max((epoch for epoch in self._plans if epoch <= now), default=None)
        if epoch is not None:
            return self._plans[epoch]
        first = self._plans[min(self._plans)] if self._plans else None
        moves = first is None or any(map(any, (first.velocity, *first.accelerations)))
        return None if moves else first
