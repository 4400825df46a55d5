"""Limits for plans: those that the autopilot can follow, with a floor above the place of the take-off."""

from __future__ import annotations

from math import inf

from companion.config import CompanionConfig
from companion.flight.autopilot_limits import AutopilotLimits
from companion.flight.lowering import Lowered
from companion.flight.takeoff import Takeoff
from companion.world import View


class PlannedLimits:
    """Limits for the plans of one vehicle, from its autopilot's ``limits`` and its ``takeoff``."""

    def __init__(self, config: CompanionConfig, limits: AutopilotLimits, takeoff: Takeoff) -> None:
        self._config = config
        self._limits = limits
        self._takeoff = takeoff
        self._above_floor = limits.lowered
        self._floor_of: tuple[Lowered, float] | None = None

    @property
    def lowered(self) -> Lowered:
        """Limits for plans: the configured ones, lowered to what the autopilot can follow.

        With ``guard.least_height`` the box's floor is at least so high above the place of the take-off. It is
        not for a vehicle that was taken over in flight, whose take-off is not known. The same object is
        returned as long as nothing changes.
        """
        lowered, start, least = self._limits.lowered, self._takeoff.start, self._config.guard.least_height
        if least is None or start is None or self._takeoff.began_in_flight:
            return lowered
        of = lowered, float(start[2]) + least
        if self._floor_of != of:
            self._floor_of, self._above_floor = of, _above(*of)
        return self._above_floor

    def escort_floor(self, view: View) -> float:
        """Return the height (m, fleet-local) above which an escort may begin during the climb.

        It is ∞ for a task other than the escort; without a target, because the vehicle would stay there; and
        in certified mode, because committed plans begin at rest.
        """
        config = self._config
        if config.task != "escort" or config.avoidance == "certified" or view.target is None:
            return inf
        return self.lowered.limits.within(config.field.margin(1)).box_min[2]


def _above(lowered: Lowered, floor: float) -> Lowered:
    """Return ``lowered`` with a box whose floor is at ``floor`` (m) at least, or at three quarters of it."""
    low, high = lowered.limits.box_min, lowered.limits.box_max
    raised = max(low[2], min(floor, low[2] + 0.75 * (high[2] - low[2])))
    return lowered._replace(limits=lowered.limits.model_copy(update={"box_min": (*low[:2], raised)}))
