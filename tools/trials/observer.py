"""True positions of the vehicles on one common time: the observers' interface, and that for emulation.

The observer of the emulation receives on a port of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.clocks.clock import Clock, WallClock
from mavlink_bridge.clocks.followed_clock import FollowedClock
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
from mavlink_bridge.wire.codec import Codec
from trials.separation import Track

Array = NDArray[np.float64]
OWN = Source(254, mavlink.MAV_COMP_ID_MISSIONPLANNER)
_READ = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
    )
)
AGAIN = 500_000
"""Wall time between two requests for missing messages (µs)."""
_PERIOD: Final = 100_000
"""Interval (µs) of positions before a companion requests another."""


class Observer(Protocol):
    """Observer of true positions.

    ``clock`` is the trial's time (µs); ``seconds`` converts it to s since the trial's beginning.
    """

    @property
    def clock(self) -> Clock:
        """Clock that the trial follows."""
        ...

    @property
    def ready(self) -> bool:
        """Whether all vehicles are known."""
        ...

    @property
    def wanted(self) -> str:
        """Description of what is missing."""
        ...

    @property
    def latest(self) -> float:
        """Time since the beginning (s); 0 before the vehicles are known."""
        ...

    @property
    def grounded(self) -> bool:
        """Whether all motors are off."""
        ...

    def seconds(self, clock: Array) -> Array:
        """Return the times (n,) since the beginning (s) at which ``clock`` had the values (n,), µs.

        Before the first message and after the last the result is constant.
        """
        ...

    def turn(self) -> None:
        """Process everything that has arrived."""
        ...

    def tracks(self) -> dict[int, Track]:
        """Return the tracks of all vehicles, by system id."""
        ...


class Seen:
    """Record of one vehicle.

    ``armed``: None before its first heartbeat. ``rows``: time since boot (µs), position (m, local NED),
    whether armed.
    """

    def __init__(self) -> None:
        self.armed: bool | None = None
        self.boot: int | None = None
        self.frame: LocalFrame | None = None
        self.rows: list[tuple[int, tuple[float, float, float], bool]] = []

    @property
    def known(self) -> bool:
        """Whether its clock and its origin have been received."""
        return self.boot is not None and self.frame is not None

    def track(self, begin: int) -> Track:
        """Return the track with times in s since ``begin`` (Unix µs).

        Raises ValueError while its clock or its origin is unknown.
        """
        if self.boot is None or self.frame is None:
            raise ValueError("its clock and its origin have not been heard")
        times = 1e-6 * (np.array([row[0] for row in self.rows]) + (self.boot - begin))
        places = self.frame.position_to_fleet(np.array([row[1] for row in self.rows]).reshape(-1, 3))
        return Track(times, places, np.array([row[2] for row in self.rows], dtype=bool))


class SitlObserver:
    """Observer of ``systems`` of ``outrider sitl`` on ``link``.

    Its clock shows the simulated time of their stamps, which is the same for all.
    """

    def __init__(self, link: Link, systems: Sequence[int], fleet: FleetFrame) -> None:
        self.link = link
        self.seen = {system: Seen() for system in systems}
        self._fleet = fleet
        self._wall = WallClock()
        self._clock = FollowedClock(self._wall)
        self._first = systems[0]
        self._next = 0
        self._ties: list[tuple[int, int]] = []
        """Clock reading at the arrival of a message, and the message's stamp (µs)."""
        self._codec = Codec(
            lambda identifier, system, component: (
                identifier in _READ and system in self.seen and component == mavlink.MAV_COMP_ID_AUTOPILOT1
            )
        )

    @property
    def clock(self) -> FollowedClock:
        """Clock that follows the first vehicle's."""
        return self._clock

    @property
    def ready(self) -> bool:
        """Whether all vehicles are known."""
        return all(one.known for one in self.seen.values())

    @property
    def wanted(self) -> str:
        """Description of what is missing; it is requested from the vehicles."""
        return "the vehicles' clocks and origins"

    @property
    def grounded(self) -> bool:
        """Whether all motors are off."""
        return all(one.armed is False for one in self.seen.values())

    @property
    def _begin(self) -> int:
        """Unix time (µs) at which the first vehicle booted."""
        return min(one.boot for one in self.seen.values() if one.boot is not None)

    @property
    def latest(self) -> float:
        """Time since the first boot (s), as last reported; 0 before the vehicles are known."""
        one = self.seen[self._first]
        return float(self._since(np.array(one.rows[-1][0]))) if self.ready and one.rows else 0.0

    def seconds(self, clock: Array) -> Array:
        """Return the times (n,) since the first boot (s) at which ``clock`` had the values (n,), µs.

        The clock goes on while the simulation pauses; the result does not.
        """
        shown, stamps = np.array(self._ties, dtype=np.float64).T
        return np.interp(clock, shown, self._since(stamps))

    def _since(self, stamps: Array) -> Array:
        """Convert stamps (n,) of the first vehicle (µs) to times since the beginning (s)."""
        boot = self.seen[self._first].boot
        since: Array = (stamps + (0 if boot is None else boot - self._begin)) * 1e-6
        return since

    def tracks(self) -> dict[int, Track]:
        """Return the tracks of all vehicles, by system id."""
        return {system: one.track(self._begin) for system, one in self.seen.items()}

    def turn(self) -> None:
        """Process everything that has arrived, and request what is missing."""
        for data in self.link.receive():
            for message in self._codec.feed(data, whole=True):
                one = self.seen[message.source.system]
                if isinstance(message, LocalPosition):
                    one.rows.append((message.time_boot, message.position_ned, bool(one.armed)))
                    if message.source.system == self._first:
                        self._clock.observe(self._wall.now(), message.time_boot)
                        self._ties.append((self._clock.now(), message.time_boot))
                elif isinstance(message, Heartbeat):
                    one.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                elif isinstance(message, SystemTime):
                    one.boot = message.unix_time - message.time_boot
                elif isinstance(message, GpsGlobalOrigin):
                    one.frame = self._fleet.local(message.latitude, message.longitude, message.altitude)
        self._ask()

    def _ask(self) -> None:
        now = self._wall.now()
        if now < self._next:
            return
        self._next = now + AGAIN
        for system, one in self.seen.items():
            missing = {
                mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: one.frame is None,
                mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: one.boot is None,
            }
            for wanted in (number for number, absent in missing.items() if absent):
                self._order(system, mavlink.MAV_CMD_REQUEST_MESSAGE, wanted, 0)
            if not one.rows:
                # ArduPilot streams nothing unasked; companions raise the rate later.
                position = mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
                self._order(system, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, position, _PERIOD)

    def _order(self, system: int, command: int, message_id: int, value: int) -> None:
        params = (float(message_id), float(value), 0.0, 0.0, 0.0, 0.0, 0.0)
        order = CommandLong(OWN, system, mavlink.MAV_COMP_ID_AUTOPILOT1, command, 0, params)
        self.link.send(self._codec.encode(order))
