"""What is at the far ends of the links of ``outrider fly``: a vehicle of the SITL, and a target."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.links.link import Link
from mavlink_bridge.messages import Heartbeat
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.simulation.beacon import Beacon
from outrider.simulation.paths import Motion
from outrider.sitl_server.request import Options, checked
from sitl.autopilot.saved import Saved
from sitl.node import LINK

START: Final = 1_767_225_600_000_000
"""µs"""
STEP: Final = 10_000
"""µs of the vehicle's time."""
FLEET: Final = FleetFrame(47.397742, 8.545594, 488.0)
ORBIT, TURN = 8.0, 0.1
"""m and rad/s of the target's circle."""


class Vehicle:
    """One of ``outrider sitl``, ``speed`` times as fast as the clock, at the far end of ``link``."""

    def __init__(self, flavour: str, speed: float, link: Link) -> None:
        self._node = checked(Options(flavour=flavour)).autopilot(0, START, Saved())
        self._link, self._codec = link, Codec()
        self._period = round(STEP / speed)
        self._time = 0
        self.due = START
        """µs of the clock, of its next step."""
        self.beats: list[Heartbeat] = []

    def step(self) -> None:
        """Go on by a step, and send what is due."""
        inbox = [Datagram(LINK, data) for data in self._link.receive()]
        for datagram in self._node.step(self._time, inbox):
            self._link.send(datagram.data)
            said = self._codec.feed(datagram.data, whole=True)
            self.beats += [message for message in said if isinstance(message, Heartbeat)]
        self._time += STEP
        self.due += self._period

    def mode(self) -> int | None:
        """Return the mode in its last HEARTBEAT, None without one."""
        return self.beats[-1].custom_mode if self.beats else None


class Target:
    """Flies a circle and sends its place five times a second.

    Its time is ``speed`` times as fast as ``clock``.
    """

    def __init__(self, link: Link, speed: float, clock: Callable[[], float]) -> None:
        self._link, self._speed, self._clock = link, speed, clock
        self._beacon = Beacon(100, "target", 5.0, FLEET)
        self._began = clock()

    def pump(self) -> None:
        """Send what is due."""
        t = (self._clock() - self._began) * self._speed
        if self._beacon.due(round(t * 1e6)):
            place = ORBIT * np.array([np.sin(TURN * t), np.cos(TURN * t) - 1.0, 0.0])
            velocity = ORBIT * TURN * np.array([np.cos(TURN * t), -np.sin(TURN * t), 0.0])
            for datagram in self._beacon.say(round(t * 1e6), Motion(place, velocity)):
                self._link.send(datagram.data)
