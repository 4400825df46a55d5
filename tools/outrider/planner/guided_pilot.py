"""Pilot of a vehicle that its caller flies: it is always under way, and there are no commands."""

from __future__ import annotations

from companion.config import CompanionConfig
from companion.flight.state_machine import Pilot
from companion.values.phase import Phase
from companion.values.stance import Stance
from mavlink_bridge.messages import Source


class GuidedPilot(Pilot):
    """Pilot in phase ESCORT whose vehicle follows the set-points."""

    def __init__(self, config: CompanionConfig, own: Source) -> None:
        super().__init__(config, own, 0.0)
        self.phase = Phase.ESCORT

    @property
    def guided(self) -> bool:
        """True: the vehicle follows the set-points."""
        return True

    @property
    def streaming(self) -> bool:
        """True: the caller sends set-points."""
        return True

    @property
    def stance(self) -> Stance:
        """The vehicle neither stands on the ground nor takes off or lands."""
        return Stance.FREE

    def steers(self, now: int) -> bool:
        """Return True: the vehicle follows the set-points."""
        return True
