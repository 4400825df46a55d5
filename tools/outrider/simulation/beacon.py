"""Beacon: sender of GLOBAL_POSITION_INT of one system at a fixed rate on one link."""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from companion.telemetry.sharing import position_message
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.simulation.paths import Motion


class Beacon:
    """Sender of positions as ``system`` on ``link``, ``rate_hz`` times a second; times are µs."""

    def __init__(self, system: int, link: str, rate_hz: float, fleet: FleetFrame) -> None:
        self.source = Source(system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._link, self._fleet = link, fleet
        self._period = round(1e6 / rate_hz)
        self._boot: int | None = None
        self._next: int | None = None
        self._codec = Codec()

    def hasten(self, now: int) -> None:
        """Make the next message due at ``now``; the later ones follow by the period."""
        self._next = now

    def due(self, now: int) -> bool:
        """Return whether a message is due at ``now``, and if so, advance to the next one."""
        if self._boot is None:
            self._boot = now
        if self._next is None:
            self._next = now
        if now < self._next:
            return False
        self._next += self._period
        return True

    def say(self, now: int, motion: Motion, plan: Tunnel | None = None) -> list[Datagram]:
        """Return a message with position and velocity at ``now``, and with ``plan`` if there is one."""
        since_boot = now - (now if self._boot is None else self._boot)
        said = position_message(self.source, since_boot, self._fleet, motion.position, motion.velocity, None)
        data = self._codec.encode(said)
        return [Datagram(self._link, data if plan is None else data + self._codec.encode(plan))]
