"""A swarm link that runs through the test: it carries what companions say to each other and the target to
all, and may cut it."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from outrider.simulation.beacon import Beacon
from outrider.simulation.paths import Motion
from tests.outrider.onboard.far_ends import FLEET
from tests.outrider.onboard.process import HOST


class Switch:
    """The swarm's links in one place: what a companion says goes to all others, and the target's words to
    all. ``cut``: systems that nothing passes to or from; ``silent``: whether the target is."""

    def __init__(self) -> None:
        self._ends: dict[int, socket.socket] = {}
        self._peers: dict[int, Any] = {}
        self._beacon = Beacon(100, "target", 5.0, FLEET)
        self._began = time.monotonic()
        self.cut: set[int] = set()
        self.silent = False
        self.noise: dict[int, Callable[[], bytes]] = {}

    def port(self, system: int) -> int:
        """Where the companion of ``system`` speaks to."""
        end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        end.bind((HOST, 0))
        end.setblocking(False)
        self._ends[system] = end
        return int(end.getsockname()[1])

    def pump(self) -> None:
        """Carry on what has come; say what is due."""
        for system, end in self._ends.items():
            while True:
                try:
                    data, self._peers[system] = end.recvfrom(65536)
                except OSError:
                    break
                if system not in self.cut:
                    for other in self._ends.keys() - self.cut - {system}:
                        self._say(other, data)
        now = round(1e6 * (time.monotonic() - self._began))
        if self._beacon.due(now):
            angle = 0.1e-6 * now
            place = 6.0 * np.array([math.cos(angle), math.sin(angle), 0.0])
            velocity = 0.6 * np.array([-math.sin(angle), math.cos(angle), 0.0])
            for datagram in self._beacon.say(now, Motion(place, velocity)):
                for system in self._ends.keys() - self.cut if not self.silent else ():
                    self._say(system, datagram.data)
        for system, noise in self.noise.items():
            self._say(system, noise())

    def _say(self, system: int, data: bytes) -> None:
        if system in self._peers:
            try:
                self._ends[system].sendto(data, self._peers[system])
            except OSError:
                # Nobody listens at present.
                return

    def close(self) -> None:
        for end in self._ends.values():
            end.close()
