"""Reception of set-points: each is read, timestamped, and followed or refused.

A refused set-point is answered with STATUSTEXT (253), at most once a second for the same reason. The vehicle
then continues unchanged, or brakes where the firmware understands "stop".
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from mavlink_bridge.messages import SetpointAttitude, SetpointGlobal, SetpointLocal
from sitl.autopilot.firmware import Firmware, Status
from sitl.autopilot.global_setpoints import localised
from sitl.autopilot.guidance import Activity, Guidance
from sitl.telemetry.status_text import StatusReporter
from sitl.values.home import Home
from sitl.values.origin import Origin
from sitl.values.setpoints import POSITION, Pose, Reading, Setpoint, Stop

_SECOND: Final = 1_000_000
# Rise (m), climb rate (m/s) or acceleration (m/s²) above which a set-point lifts the vehicle off the ground.
_RISING: Final = (0.2, 0.1, 0.1)
# Pause (µs) after which a set-point begins a new stream.
_PAUSE: Final = 2 * _SECOND


class Stream(NamedTuple):
    """Newest usable set-point, with its time of arrival and that of its predecessor (µs)."""

    setpoint: Setpoint | None = None
    newest: float = -math.inf
    older: float = -math.inf

    def age(self, now: int) -> float:
        """Return the seconds since the newest set-point; ∞ before the first."""
        return (now - self.newest) / _SECOND

    @property
    def gap(self) -> float:
        """Seconds between the last two; 0 for the first of a stream."""
        gap = self.newest - self.older
        return gap / _SECOND if gap < _PAUSE else 0.0


class SetpointReception:
    """Converter of set-point messages into set-points for the guidance."""

    def __init__(
        self, flavour: Firmware, guidance: Guidance, origin: Origin, home: Home, voice: StatusReporter
    ) -> None:
        """``origin`` and ``home`` are the references of global positions and heights."""
        self._flavour = flavour
        self._guidance = guidance
        self._origin = origin
        self._home = home
        self._voice = voice
        self.stream = Stream()

    def steer(
        self,
        message: SetpointLocal | SetpointGlobal | SetpointAttitude,
        status: Status,
        here: Pose,
        now: int,
    ) -> bool:
        """Handle one set-point addressed to this vehicle that arrived at ``now`` (µs).

        Return whether it can be flown.
        """
        reading = self._read(message, here)
        if not isinstance(reading, Setpoint):
            denial = self._flavour.steering_denial(status)
            self._voice.complain(denial or reading.reason, now)
            if isinstance(reading, Stop) and denial is None and self._guidance.activity is Activity.TRACK:
                self._guidance.hold()
            return False
        self.stream = Stream(reading, now, self.stream.newest)
        denial = self._flavour.steering_denial(status)
        if denial is None:
            self._follow(reading, here, now)
        elif denial:
            self._voice.complain(denial, now)
        return True

    def resume(self, here: Pose, now: int) -> None:
        """Follow the newest set-point of a stream that began before it could take effect, or hold."""
        setpoint = self.stream.setpoint
        if self._flavour.stream_first and setpoint is not None:
            self._follow(setpoint, here, now)
        else:
            self._guidance.hold()

    def _read(self, message: SetpointLocal | SetpointGlobal | SetpointAttitude, here: Pose) -> Reading:
        if isinstance(message, SetpointAttitude):
            return self._flavour.read_attitude(message)
        if isinstance(message, SetpointGlobal):
            local = localised(message, self._origin, self._home, stops=self._flavour.stops)
            return self._flavour.read(local, here) if isinstance(local, SetpointLocal) else local
        return self._flavour.read(message, here)

    def _follow(self, setpoint: Setpoint, here: Pose, now: int) -> None:
        if self._guidance.activity is Activity.IDLE and not _rises(setpoint, here):
            return
        received = int(self.stream.newest)
        self._guidance.track(setpoint, received, self._flavour.timeout(setpoint), here, now)


def _rises(setpoint: Setpoint, here: Pose) -> bool:
    """Return whether a set-point leads off the ground."""
    level = setpoint.levels[2]
    z = (setpoint.position, setpoint.velocity, setpoint.acceleration)[level][2]
    return (here.position[2] if level == POSITION else 0.0) - z > _RISING[level]
