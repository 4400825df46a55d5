"""Tracking of a committed plan: feed-forward of the plan, and the disturbance observer beside it."""

from __future__ import annotations

import numpy as np

from companion.config.flight import TrackingConfig
from companion.flight.autopilots import Loop
from companion.flight.plan_feedforward import USUAL_DRAG, Additions, PlanFeedforward
from companion.flight.tracking import Tracking
from companion.values.horizon import Array, Horizon, Motion


class PlanTracking(Tracking):
    """``Tracking`` of a vehicle that flies committed plans.

    Where the autopilot follows a trajectory of its own (``Loop.inverse``), the integral of its velocity loop
    is left to compensate wind, and the observer only estimates the drag.
    """

    def __init__(self, config: TrackingConfig) -> None:
        # Without ``usual`` no distance depends on the tracking error.
        super().__init__(config.model_copy(update={"usual": None}))
        self._feedforward_of_plan = PlanFeedforward()
        self._additions = Additions()
        self._drag = USUAL_DRAG if config.compensate else 0.0

    def _reset(self) -> None:
        super()._reset()
        self._additions = Additions()

    def follow(self, now: int, horizon: Horizon, measured: Motion, loop: Loop) -> None:
        """Update with the ``measured`` motion at ``now`` (µs) of a vehicle that flies ``horizon``."""
        inverse, planned = loop.inverse, horizon.at(now)
        if inverse is None:
            later = horizon.at(now + self.lead(loop)).acceleration
            self.observe(now, planned._replace(acceleration=later), measured, loop)
        else:
            aside = self._additions
            moved = Motion(
                planned.position + aside.offset,
                planned.velocity + aside.offset_velocity,
                planned.acceleration + aside.acceleration,
            )
            # The trajectory that the autopilot follows is known, and nothing is added to its acceleration.
            self.observe(now, moved, measured, loop._replace(shaping=None, integral=inverse.integral))
            self.compensation = np.zeros(3)
        self._additions = self._feedforward_of_plan.step(now, horizon.at, loop, self.drag)

    @property
    def added_velocity(self) -> Array:
        """Addition (3,), m/s, to the velocity of set-points besides ``bias``."""
        return self._additions.velocity

    @property
    def added_acceleration(self) -> Array:
        """Addition (3,), m/s², to the acceleration of set-points."""
        return self.compensation + self._additions.acceleration
