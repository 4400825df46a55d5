"""The target: it circles, tells so, and can fall silent, or stop."""

from __future__ import annotations

import random

import numpy as np

from mavlink_bridge.clock import WallClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.links.opening import open_link
from outrider.beacon import Beacon
from outrider.paths import Motion
from trials.plan import HOST, TARGET

_RADIUS, _TURN, _RATE = 8.0, 0.1, 5.0
"""m, rad/s, Hz: 0.8 m/s, a walk."""
_MIDDLE = np.array([3.0, 1.5, 0.0])
"""m, of the grid on which the vehicles start: it never walks among them."""


class Walker:
    """Asked where it is at a time (µs), and to say so then, to all who listen at ``endpoint``."""

    def __init__(self, fleet: FleetFrame) -> None:
        self.silent = False
        # A group of its own: several trials may go on at a time.
        group = f"239.255.{random.randrange(1, 250)}.{random.randrange(1, 250)}"
        self.endpoint = f"mcast:{group}:{random.randrange(16_000, 28_000)},{HOST}"
        self._link = open_link(self.endpoint, WallClock())
        self._stopped: int | None = None
        self._beacon = Beacon(TARGET, "target", _RATE, fleet)

    def stop(self, now: int) -> None:
        """Stand still from then on."""
        self._stopped = now

    def motion(self, now: int) -> Motion:
        """At ``now``."""
        walks = self._stopped is None or now < self._stopped
        angle = _TURN * 1e-6 * (now if walks or self._stopped is None else self._stopped)
        place = _MIDDLE + _RADIUS * np.array([np.sin(angle), np.cos(angle), 0.0])
        velocity = _RADIUS * _TURN * np.array([np.cos(angle), -np.sin(angle), 0.0])
        return Motion(place, velocity if walks else np.zeros(3))

    def turn(self, now: int) -> None:
        """Say what is due at ``now``."""
        if self._beacon.due(now) and not self.silent:
            for datagram in self._beacon.say(now, self.motion(now)):
                self._link.send(datagram.data)

    def close(self) -> None:
        """Its link."""
        self._link.close()
