"""The observer of real firmware's simulations: SIM_STATE of ArduPilot's SITL, HIL_STATE_QUATERNION of PX4's
SIH, by the time of the wall, which is what they all have in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.clocks.clock import Clock, WallClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandLong, Heartbeat, HilState, SimulationState
from mavlink_bridge.wire.codec import Codec
from trials.ears import Ear
from trials.observer import AGAIN, ARMED, OWN
from trials.separation import Track

Array = NDArray[np.float64]
_HEARTBEAT, _SIM_STATE, _HIL_STATE = 0, 108, 115
_SET_INTERVAL: Final = 511
_PERIOD: Final = 20_000
"""µs asked for between two of a vehicle's true states."""
_SILENT: Final = 1_000_000
"""µs of the wall after which they are asked for again."""
_ARDUPILOT: Final = "ardupilot"
_GROUND_STATION: Final = (6, 8, 0, 0, 4)
"""MAV_TYPE, MAV_AUTOPILOT (none), modes, MAV_STATE."""


class TrueSeen:
    """One vehicle. ``rows``: time of the wall (µs), position (m, fleet frame), whether armed."""

    def __init__(self) -> None:
        self.armed: bool | None = None
        self.heard = 0
        self.rows: list[tuple[int, tuple[float, float, float], bool]] = []

    def track(self, begin: int) -> Track:
        """Times are s since ``begin``."""
        places = np.array([row[1] for row in self.rows]).reshape(-1, 3)
        times = 1e-6 * (np.array([row[0] for row in self.rows]) - begin)
        return Track(times, places, np.array([row[2] for row in self.rows], dtype=bool))


class TruthObserver:
    """Hears the vehicles of ``flavours``, by their system ids, at ``ears``."""

    def __init__(
        self,
        ears: Mapping[int, Ear],
        flavours: Mapping[int, str],
        fleet: FleetFrame,
        clock: Clock | None = None,
    ) -> None:
        self.seen = {system: TrueSeen() for system in flavours}
        self._ears, self._flavours, self._fleet = ears, flavours, fleet
        self._clock = WallClock() if clock is None else clock
        self._begin = self._clock.now()
        self._next = 0
        wanted = (_HEARTBEAT, _SIM_STATE, _HIL_STATE)
        self._codecs = {
            id(ear): Codec(
                lambda identifier, system, component: (
                    identifier in wanted and system in self.seen and component == 1
                )
            )
            for ear in ears.values()
        }

    @property
    def clock(self) -> Clock:
        """The wall's."""
        return self._clock

    @property
    def ready(self) -> bool:
        """Whether the true state of all is told."""
        return all(one.rows and one.armed is not None for one in self.seen.values())

    @property
    def wanted(self) -> str:
        """What those do not tell that are not ready."""
        names = {True: "SIM_STATE", False: "HIL_STATE_QUATERNION"}
        return ", ".join(
            f"{names[self._flavours[system] == _ARDUPILOT]} of vehicle {system}"
            for system, one in self.seen.items()
            if not one.rows or one.armed is None
        )

    @property
    def grounded(self) -> bool:
        """Whether no motors run."""
        return all(one.armed is False for one in self.seen.values())

    @property
    def latest(self) -> float:
        """s since it began to listen."""
        return (self._clock.now() - self._begin) * 1e-6

    def seconds(self, clock: Array) -> Array:
        """s since then, when the clock showed that."""
        since: Array = (clock - self._begin) * 1e-6
        return since

    def tracks(self) -> dict[int, Track]:
        """Of all."""
        return {system: one.track(self._begin) for system, one in self.seen.items()}

    def turn(self) -> None:
        """Hear what has come."""
        now = self._clock.now()
        for ear in {id(ear): ear for ear in self._ears.values()}.values():
            for data in ear.receive():
                for message in self._codecs[id(ear)].feed(data, whole=True):
                    one = self.seen[message.source.system]
                    if isinstance(message, SimulationState | HilState):
                        place = self._fleet.to_enu(message.latitude, message.longitude, message.altitude)
                        east, north, up = place.tolist()
                        one.rows.append((now, (east, north, up), bool(one.armed)))
                        one.heard = now
                    elif isinstance(message, Heartbeat):
                        one.armed = bool(message.base_mode & ARMED)
        if now >= self._next:
            self._next = now + AGAIN
            self._ask(now)

    def _ask(self, now: int) -> None:
        for system, one in self.seen.items():
            ear = self._ears[system]
            codec = self._codecs[id(ear)]
            ear.tell(system, codec.encode(Heartbeat(OWN, *_GROUND_STATION)))
            if now - one.heard > _SILENT:
                wanted = _SIM_STATE if self._flavours[system] == _ARDUPILOT else _HIL_STATE
                params = (float(wanted), float(_PERIOD), 0.0, 0.0, 0.0, 0.0, 0.0)
                ear.tell(system, codec.encode(CommandLong(OWN, system, 1, _SET_INTERVAL, 0, params)))
