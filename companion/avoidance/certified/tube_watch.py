"""Distance of a vehicle from its plan, and how far it is outside its tube."""

from __future__ import annotations

import numpy as np

from companion.avoidance.certified.commitment import Commitment
from companion.config import CompanionConfig
from companion.values.horizon import Motion


class TubeWatch:
    """Tube of one vehicle: ``tube`` around a plan in space; around a column ``drift``, if it is larger."""

    def __init__(self, config: CompanionConfig, commitment: Commitment) -> None:
        self._tube = config.certified.tube
        self._column = max(config.certified.tube, config.certified.drift)
        self._guard = config.guard.tube
        self._commitment = commitment
        self.deviation = self.largest_deviation = 0.0
        """Distance (m) of the vehicle from its plan: ``deviation`` now, ``largest_deviation`` at most."""
        self.outside = 0.0
        """Distance (m) by which the vehicle is outside its tube; 0 inside."""
        self.left = 0
        """Number of times that the vehicle left the tube."""

    def watch(self, now: int, measured: Motion) -> None:
        """Record how far the vehicle is from its plan at ``now`` (µs).

        Outside the tube the guarantee is suspended; the plan stays, because the autopilot returns to it. The
        statements give the excess, and until the vehicle is back, it and the others keep more distance in new
        plans, each two of them twice the excess, where their committed plans do.
        """
        horizon = self._commitment.horizon()
        if horizon is None:
            return
        difference, within = horizon.at(now).position - measured.position, self._tube
        plan = self._commitment.of(now)
        if plan is not None and plan.column:
            difference[2], within = 0.0, self._column
        self.deviation = float(np.sqrt(difference @ difference))
        self.largest_deviation = max(self.largest_deviation, self.deviation)
        outside = max(0.0, self.deviation - within)
        self.left += outside > 0.0 and not self.outside
        self.outside = outside

    @property
    def lost(self) -> bool:
        """Whether the vehicle is further than ``guard.tube`` (m) from its plan: planning then begins anew."""
        return self.deviation > self._guard
