"""Where the vehicles truly are, by what the SITL tells of them on a port of its own, in the one time that
they all have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.clock import WallClock
from mavlink_bridge.codec import Codec
from mavlink_bridge.followed_clock import FollowedClock
from mavlink_bridge.frames import FleetFrame, LocalFrame
from mavlink_bridge.links.link import Link
from mavlink_bridge.messages import (
    CommandLong,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Source,
    SystemTime,
)

_OWN = Source(254, 190)
_HEARTBEAT, _TIME, _LOCAL, _ORIGIN = 0, 2, 32, 49
_REQUEST = 512
_ARMED = 0x80
_AGAIN = 500_000
"""µs of the wall between two askings for what is missing."""


class Seen:
    """One vehicle. ``armed``: None before its first heartbeat. ``rows``: time since boot (µs), position (m,
    local NED), whether armed."""

    def __init__(self) -> None:
        self.armed: bool | None = None
        self.mode = 0
        self.boot: int | None = None
        self.frame: LocalFrame | None = None
        self.rows: list[tuple[int, tuple[float, float, float], bool]] = []

    @property
    def known(self) -> bool:
        """Whether its clock and its origin have been heard."""
        return self.boot is not None and self.frame is not None

    def track(self, begin: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Times (n,) s since ``begin`` (Unix µs), positions (n, 3) m fleet-local ENU, armed (n,)."""
        if self.boot is None or self.frame is None:
            raise ValueError("its clock and its origin have not been heard")
        times = 1e-6 * (np.array([row[0] for row in self.rows]) + (self.boot - begin))
        places = self.frame.position_to_fleet(np.array([row[1] for row in self.rows]).reshape(-1, 3))
        return times, places, np.array([row[2] for row in self.rows], dtype=bool)


class Observer:
    """Hears ``systems`` on ``link``. ``clock`` shows simulated time (µs) as their stamps do, all the same."""

    def __init__(self, link: Link, systems: Sequence[int], fleet: FleetFrame) -> None:
        self.link = link
        self.seen = {system: Seen() for system in systems}
        self._fleet = fleet
        self._wall = WallClock()
        self.clock = FollowedClock(self._wall)
        self._first = systems[0]
        self._next = 0
        self._codec = Codec(
            lambda identifier, system, component: (
                identifier in (_HEARTBEAT, _TIME, _LOCAL, _ORIGIN) and system in self.seen and component == 1
            )
        )

    @property
    def ready(self) -> bool:
        """Whether all are known."""
        return all(one.known for one in self.seen.values())

    @property
    def begin(self) -> int:
        """Unix time (µs) at which the first of them booted."""
        return min(one.boot for one in self.seen.values() if one.boot is not None)

    @property
    def latest(self) -> float:
        """s since then, as told last; 0 before they are known."""
        one = self.seen[self._first]
        if not self.ready or not one.rows or one.boot is None:
            return 0.0
        return (one.rows[-1][0] + one.boot - self.begin) * 1e-6

    def turn(self) -> None:
        """Hear what has come."""
        for data in self.link.receive():
            for message in self._codec.feed(data, whole=True):
                one = self.seen[message.source.system]
                if isinstance(message, LocalPosition):
                    one.rows.append((message.time_boot, message.position_ned, bool(one.armed)))
                    if message.source.system == self._first:
                        self.clock.observe(self._wall.now(), message.time_boot)
                elif isinstance(message, Heartbeat):
                    one.armed, one.mode = bool(message.base_mode & _ARMED), message.custom_mode
                elif isinstance(message, SystemTime):
                    one.boot = message.unix_time - message.time_boot
                elif isinstance(message, GpsGlobalOrigin):
                    one.frame = self._fleet.local(message.latitude, message.longitude, message.altitude)
        self._ask()

    def _ask(self) -> None:
        now = self._wall.now()
        if now < self._next:
            return
        self._next = now + _AGAIN
        for system, one in self.seen.items():
            for wanted, missing in ((_ORIGIN, one.frame is None), (_TIME, one.boot is None)):
                if missing:
                    params = (float(wanted), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                    self.link.send(self._codec.encode(CommandLong(_OWN, system, 1, _REQUEST, 0, params)))
