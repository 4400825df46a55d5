"""Positions of vehicles by the times at which they arrive, for vehicles whose clocks differ."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.clocks.clock import Clock, WallClock
from mavlink_bridge.frames import FleetFrame, LocalFrame
from mavlink_bridge.links.link import Link
from mavlink_bridge.messages import CommandLong, GpsGlobalOrigin, Heartbeat, LocalPosition
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from trials.observer import AGAIN, OWN
from trials.separation import Track

Array = NDArray[np.float64]

_MESSAGES: Final = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
    )
)


class Arrivals:
    """Positions of ``systems`` as they arrive on ``link``; ``fleet``: the frame of all positions.

    All times are s since the beginning. ``signing``: for the requests; what arrives is not checked.
    """

    def __init__(
        self,
        link: Link,
        systems: Sequence[int],
        fleet: FleetFrame,
        signing: Signing | None = None,
        clock: Clock | None = None,
    ) -> None:
        self._clock = WallClock() if clock is None else clock
        self._begin = self._clock.now()
        self._requests = Codec(None, signing)
        self._link, self._fleet = link, fleet
        self._codec = Codec(
            lambda identifier, system, component: (
                identifier in _MESSAGES and system in systems and component == mavlink.MAV_COMP_ID_AUTOPILOT1
            )
        )
        self._frames: dict[int, LocalFrame | None] = dict.fromkeys(systems)
        self._armed = dict.fromkeys(systems, False)
        self._rows: dict[int, list[tuple[float, tuple[float, float, float], bool]]] = {s: [] for s in systems}
        self._next = 0

    @property
    def sockets(self) -> list[int]:
        """File descriptors of which one is readable when something has arrived."""
        number = self._link.fileno()
        return [] if number is None else [number]

    @property
    def latest(self) -> float:
        """Time since the beginning (s)."""
        return 1e-6 * (self._clock.now() - self._begin)

    def seconds(self, clock: Array) -> Array:
        """Return the times (n,) since the beginning (s) at which the wall clock had the values (n,), µs."""
        since: Array = 1e-6 * (clock - self._begin)
        return since

    def turn(self) -> None:
        """Process everything that has arrived, and request missing origins."""
        clock = self._clock.now()
        now = 1e-6 * (clock - self._begin)
        for data in self._link.receive():
            for message in self._codec.feed(data, whole=True):
                system = message.source.system
                if isinstance(message, LocalPosition):
                    self._rows[system].append((now, message.position_ned, self._armed[system]))
                elif isinstance(message, Heartbeat):
                    self._armed[system] = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                elif isinstance(message, GpsGlobalOrigin):
                    place = message.latitude, message.longitude, message.altitude
                    self._frames[system] = self._fleet.local(*place)
        if clock < self._next:
            return
        self._next = clock + AGAIN
        params = (float(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for system in (system for system, frame in self._frames.items() if frame is None):
            whom = system, mavlink.MAV_COMP_ID_AUTOPILOT1
            request = CommandLong(OWN, *whom, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, params)
            self._link.send(self._requests.encode(request))

    def place(self, system: int) -> Array | None:
        """Return the last position (3,) m of ``system``; None before the first."""
        frame, rows = self._frames[system], self._rows[system]
        return frame.position_to_fleet(np.array([rows[-1][1]]))[0] if frame is not None and rows else None

    def tracks(self) -> dict[int, Track]:
        """Return the tracks of the vehicles whose origin is known, on the time of arrival."""
        found = {}
        for system, rows in self._rows.items():
            frame = self._frames[system]
            if frame is not None and rows:
                places = frame.position_to_fleet(np.array([row[1] for row in rows]))
                armed = np.array([row[2] for row in rows], dtype=bool)
                found[system] = Track(np.array([row[0] for row in rows]), places, armed)
        return found
