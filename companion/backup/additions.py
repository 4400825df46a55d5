"""What a companion adds to its plan in set-points, observed by its backup node, which continues it."""

from __future__ import annotations

import numpy as np

from companion.backup.announced_plans import AnnouncedPlans
from companion.config.flight import TrackingConfig
from companion.errors import CompanionError
from companion.flight.autopilots import Loop
from companion.flight.plan_feedforward import USUAL_DRAG, Additions, PlanFeedforward
from companion.flight.sent_compensation import SentCompensation
from companion.values.horizon import Array, Motion


class SentAdditions:
    """Additions to the ``plans`` of one companion: feed-forward of the plan, and compensation as sent."""

    def __init__(self, config: TrackingConfig, plans: AnnouncedPlans) -> None:
        self._config, self._plans = config, plans
        self.forget()

    def forget(self) -> None:
        """Discard what was observed."""
        self._compensation, self._feedforward = SentCompensation(), PlanFeedforward()

    def observe(self, now: int, time: int, sent: Array, loop: Loop) -> None:
        """Observe the acceleration ``sent`` (3,), m/s², at ``now`` (µs) in a set-point for ``time`` (µs)."""
        horizon = self._plans.horizon(time)
        if horizon is None:
            return
        of_plan = self._feedforward.step(time, self._planned, loop, USUAL_DRAG)
        if loop.inverse is not None:
            return
        planned = self._planned(time + loop.lead_us).acceleration + of_plan.acceleration
        added = sent[:2] - planned[:2]
        # Written so that a NaN is not observed. A plan that has not arrived yet makes a larger difference.
        if added @ added <= self._config.most**2:
            self._compensation.observe(now, horizon.at(time).velocity[:2], added)

    def at(self, time: int, planned: Motion, loop: Loop) -> Additions:
        """Return what the set-point at ``time`` (µs) adds to the ``planned`` motion, as the companion's."""
        of_plan = self._feedforward.step(time, self._planned, loop, USUAL_DRAG)
        ahead = self._planned(time + loop.lead_us).acceleration - planned.acceleration
        compensation, most = self._compensation.at(planned.velocity[:2]), self._config.most
        compensation *= min(1.0, most / max(float(np.linalg.norm(compensation)), most))
        sent = ahead + compensation + of_plan.acceleration
        return of_plan._replace(acceleration=sent)

    def _planned(self, time: int) -> Motion:
        """Return the planned motion at ``time`` (µs); it may be that of the plan to come."""
        horizon = self._plans.horizon(time)
        if horizon is None:
            raise CompanionError("there is no committed plan yet")
        return horizon.at(time)
