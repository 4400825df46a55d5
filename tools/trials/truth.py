"""Observer of real firmware's simulations.

It uses SIM_STATE of ArduPilot's SITL and HIL_STATE_QUATERNION of PX4's SIH, dated by wall time, which all of
them share.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.clocks.clock import Clock, WallClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandLong, Heartbeat, HilState, SimulationState
from mavlink_bridge.wire.codec import Codec
from trials.observer import AGAIN, OWN
from trials.receivers import Receiver
from trials.separation import Track

Array = NDArray[np.float64]
_PERIOD: Final = 20_000
"""Requested period of a vehicle's true state (µs)."""
_SILENT: Final = 1_000_000
"""Wall time without a true state after which it is requested again (µs)."""
_ARDUPILOT: Final = "ardupilot"
_GROUND_STATION: Final = Heartbeat(
    OWN, mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE
)
_READ: Final = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_SIM_STATE,
        mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
    )
)


class TruthRecord:
    """Record of one vehicle; ``rows``: wall time (µs), position (m, fleet frame), whether armed."""

    def __init__(self) -> None:
        self.armed: bool | None = None
        self.received = 0
        self.rows: list[tuple[int, tuple[float, float, float], bool]] = []

    def track(self, begin: int) -> Track:
        """Return the track with times in s since ``begin`` (µs)."""
        places = np.array([row[1] for row in self.rows]).reshape(-1, 3)
        times = 1e-6 * (np.array([row[0] for row in self.rows]) - begin)
        return Track(times, places, np.array([row[2] for row in self.rows], dtype=bool))


class TruthObserver:
    """Observer of the vehicles of ``flavours``, by system id, through the ``receivers``."""

    def __init__(
        self,
        receivers: Mapping[int, Receiver],
        flavours: Mapping[int, str],
        fleet: FleetFrame,
        clock: Clock | None = None,
    ) -> None:
        self.seen = {system: TruthRecord() for system in flavours}
        self._receivers, self._flavours, self._fleet = receivers, flavours, fleet
        self._clock = WallClock() if clock is None else clock
        self._begin = self._clock.now()
        self._next = 0
        self._codecs = {
            id(receiver): Codec(
                lambda identifier, system, component: (
                    identifier in _READ
                    and system in self.seen
                    and component == mavlink.MAV_COMP_ID_AUTOPILOT1
                )
            )
            for receiver in receivers.values()
        }

    @property
    def clock(self) -> Clock:
        """Wall clock."""
        return self._clock

    @property
    def ready(self) -> bool:
        """Whether the true state of all vehicles is received."""
        return all(one.rows and one.armed is not None for one in self.seen.values())

    @property
    def wanted(self) -> str:
        """Messages that are missing from vehicles that are not ready."""
        names = {True: "SIM_STATE", False: "HIL_STATE_QUATERNION"}
        return ", ".join(
            f"{names[self._flavours[system] == _ARDUPILOT]} of vehicle {system}"
            for system, one in self.seen.items()
            if not one.rows or one.armed is None
        )

    @property
    def grounded(self) -> bool:
        """Whether all motors are off."""
        return all(one.armed is False for one in self.seen.values())

    @property
    def latest(self) -> float:
        """Time since observation began (s)."""
        return (self._clock.now() - self._begin) * 1e-6

    def seconds(self, clock: Array) -> Array:
        """Return the times (n,) since observation began (s) at which ``clock`` had the values (n,), µs."""
        since: Array = (clock - self._begin) * 1e-6
        return since

    @property
    def sockets(self) -> list[int]:
        """File descriptors of which one is readable when something has arrived."""
        numbers = {receiver.fileno() for receiver in self._receivers.values()}
        return [number for number in numbers if number is not None]

    def place(self, system: int) -> Array | None:
        """Return the last position (3,) m of ``system``; None before the first."""
        rows = self.seen[system].rows
        return np.array(rows[-1][1]) if rows else None

    def tracks(self) -> dict[int, Track]:
        """Return the tracks of the vehicles whose true state was received, by system id."""
        return {system: one.track(self._begin) for system, one in self.seen.items() if one.rows}

    def turn(self) -> None:
        """Process everything that has arrived, and request what is missing."""
        now = self._clock.now()
        for receiver in {id(receiver): receiver for receiver in self._receivers.values()}.values():
            for data in receiver.receive():
                for message in self._codecs[id(receiver)].feed(data, whole=True):
                    one = self.seen[message.source.system]
                    if isinstance(message, SimulationState | HilState):
                        place = self._fleet.to_enu(message.latitude, message.longitude, message.altitude)
                        east, north, up = place.tolist()
                        one.rows.append((now, (east, north, up), bool(one.armed)))
                        one.received = now
                    elif isinstance(message, Heartbeat):
                        one.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        if now >= self._next:
            self._next = now + AGAIN
            self._ask(now)

    def _ask(self, now: int) -> None:
        for system, one in self.seen.items():
            receiver = self._receivers[system]
            codec = self._codecs[id(receiver)]
            receiver.tell(system, codec.encode(_GROUND_STATION))
            if now - one.received > _SILENT:
                wanted = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
                if self._flavours[system] == _ARDUPILOT:
                    wanted = mavlink.MAVLINK_MSG_ID_SIM_STATE
                params = (float(wanted), float(_PERIOD), 0.0, 0.0, 0.0, 0.0, 0.0)
                whom = system, mavlink.MAV_COMP_ID_AUTOPILOT1
                request = CommandLong(OWN, *whom, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, params)
                receiver.tell(system, codec.encode(request))
