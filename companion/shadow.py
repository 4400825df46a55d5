"""A companion that only rehearses: it plans as if it flew the vehicle it listens to, and sends nothing at
all.

For logs, and for looking on at a flight of others. The vehicle does not do what is planned, so every plan
begins where the vehicle really is; committed plans, which begin where the last one said, are not for it.
"""

from __future__ import annotations

from collections.abc import Callable

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

_ALWAYS_ANEW = 1e-6
"""m: a plan that the vehicle is further from than that begins anew at the vehicle."""


class Onlooker(Pilot):
    """A pilot that is ready as soon as it knows enough to plan, whoever steers the vehicle; it takes no
    orders."""

    @property
    def guided(self) -> bool:
        return self.phase is Phase.ESCORT

    @property
    def streaming(self) -> bool:
        return self.phase is Phase.ESCORT

    def go(self, height: float) -> bool:
        return False

    def hold(self) -> bool:
        return False

    def come_back(self) -> bool:
        return False

    def land(self) -> bool:
        return False

    def alight(self) -> None:
        """The vehicle is somebody else's to land."""

    def step(self, now: int, view: View) -> list[Message]:
        """No commands, ever."""
        self.vehicle.tick(now)
        self.waiting_for = self._readiness.unseen(view)
        self.phase = Phase.CONNECT if self.waiting_for else Phase.ESCORT
        return []


class ShadowCompanion(Companion):
    """As ``Companion``, on the vehicle of ``system``. ``would``: the set-points that it would have sent since
    they were last taken away.

    CompanionError for ``avoidance: certified``.
    """

    pilots = Onlooker

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
        changes = {"tube": _ALWAYS_ANEW, "blend": None, "astray_us": 0}
        guard = config.guard.model_copy(update=changes)
        # The vehicle follows somebody else's set-points: nothing is learnt from how it does.
        config = config.model_copy(update={"guard": guard, "tracking": TrackingConfig()})
        super().__init__(config, system, target_system, fleet, stopwatch, signing)
        self.would: list[SetpointLocal] = []

    def _encode(self, **links: list[Message]) -> list[Datagram]:
        """Nothing leaves it, on any link."""
        self.would += [
            message for message in links.get("autopilot", ()) if isinstance(message, SetpointLocal)
        ]
        return []

    @property
    def lacking(self) -> str:
        """What there is no set-point for want of; empty if there is one."""
        if self.pilot.waiting_for:
            return self.pilot.waiting_for
        return "" if self.guard.horizon is not None else "a place to plan from"
