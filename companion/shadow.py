"""Shadow companion: plans as if it flew the vehicle whose messages it receives, and sends nothing.

It serves for logs, and for observing a flight that another controller flies. The vehicle does not follow
these plans, so every plan begins at the vehicle's actual position. Committed plans begin on the previous plan
and are therefore not supported.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from companion.config import CompanionConfig
from companion.config.flight import TrackingConfig
from companion.errors import CompanionError
from companion.flight.state_machine import Pilot
from companion.node import Companion
from companion.values.phase import Phase
from companion.world import View
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, SetpointLocal
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.signing import Signing

_ALWAYS_ANCHOR_TUBE_M = 1e-6
"""Value of ``guard.tube``: every plan begins at the vehicle, not on the previous plan."""


class Onlooker(Pilot):
    """Pilot that is ready once planning is possible, whichever controller steers; it refuses all orders."""

    @property
    def guided(self) -> bool:
        """Whether the shadow plans."""
        return self.phase is Phase.ESCORT

    @property
    def streaming(self) -> bool:
        """Whether the shadow plans."""
        return self.phase is Phase.ESCORT

    def go(self, height: float) -> bool:
        """Refuse the order."""
        return False

    def hold(self) -> bool:
        """Refuse the order."""
        return False

    def come_back(self) -> bool:
        """Refuse the order."""
        return False

    def land(self) -> bool:
        """Refuse the order."""
        return False

    def alight(self) -> None:
        """Do nothing: another controller lands the vehicle."""

    def step(self, now: int, view: View) -> list[Message]:
        """Update the phase; return no commands."""
        self.vehicle.tick(now)
        self.waiting_for = self._readiness.unseen(view)
        self.phase = Phase.CONNECT if self.waiting_for else Phase.ESCORT
        return []


class ShadowCompanion(Companion):
    """Companion that sends nothing, for the vehicle of ``system``.

    ``would``: the set-points that it would have sent, until the caller empties the list. Raises
    CompanionError for ``avoidance: certified``.
    """

    pilots: ClassVar[type[Pilot]] = Onlooker

    def __init__(
        self,
        config: CompanionConfig,
        system: int,
        target_system: int,
        fleet: FleetFrame,
        stopwatch: Callable[[], int],
        signing: Signing | None = None,
    ) -> None:
        if config.avoidance == "certified":
            raise CompanionError("committed plans cannot be rehearsed; allowed: avoidance 'field'")
        changes = {"tube": _ALWAYS_ANCHOR_TUBE_M, "blend": None, "astray_us": 0}
        guard = config.guard.model_copy(update=changes)
        # The vehicle follows another controller's set-points, so its tracking error cannot be learnt here.
        config = config.model_copy(update={"guard": guard, "tracking": TrackingConfig()})
        super().__init__(config, system, target_system, fleet, stopwatch, signing)
        self.would: list[SetpointLocal] = []

    def _encode(self, **links: list[Message]) -> list[Datagram]:
        """Record the set-points and send nothing, on any link."""
        self.would += [
            message for message in links.get("autopilot", ()) if isinstance(message, SetpointLocal)
        ]
        return []

    @property
    def lacking(self) -> str:
        """The missing input without which there is no set-point, or an empty string."""
        if self.pilot.waiting_for:
            return self.pilot.waiting_for
        return "" if self.flown is not None else "a place to plan from"
