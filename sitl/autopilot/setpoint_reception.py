"""Reception of set-points: each is read, and followed, refused or ignored.

A set-point on the globe is first converted to the vehicle's own local NED. A refused set-point is answered
with STATUSTEXT (253), at most once a second for the same reason. The vehicle then continues unchanged, or
brakes where the firmware understands "stop". A usable set-point is ignored without an answer if it would not
lift a standing vehicle off the ground, or if PX4 is not in OFFBOARD or is disarmed.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import SetpointAttitude, SetpointGlobal, SetpointLocal, Vector
from mavlink_bridge.messages.fields import on_globe
from sitl.autopilot.firmware import Firmware, Status
from sitl.autopilot.guidance import Activity, Guidance
from sitl.telemetry.status_text import StatusReporter
from sitl.values.home import ABOVE_HOME, ABOVE_SEA, Home
from sitl.values.origin import Origin
from sitl.values.setpoints import IGNORE_POSITION, POSITION, ZERO, Pose, Reading, Refusal, Setpoint, Stop

_SECOND: Final = 1_000_000
# Rise (m), climb rate (m/s) or acceleration (m/s²) above which a set-point lifts the vehicle off the ground.
_LIFT_OFF: Final = (0.2, 0.1, 0.1)
# Pause (µs) after which a set-point begins a new stream.
_STREAM_PAUSE_US: Final = 2 * _SECOND


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
        """Seconds between the last two set-points; 0 if the newest is the first of a stream."""
        gap = self.newest - self.older
        return gap / _SECOND if gap < _STREAM_PAUSE_US else 0.0


class SetpointReception:
    """Converter of set-point messages into set-points for the guidance."""

    def __init__(
        self, flavour: Firmware, guidance: Guidance, origin: Origin, home: Home, status_text: StatusReporter
    ) -> None:
        """``origin`` and ``home`` are the references of global positions and heights."""
        self._flavour = flavour
        self._guidance = guidance
        self._origin = origin
        self._home = home
        self._status_text = status_text
        self.stream = Stream()

    def steer(
        self,
        message: SetpointLocal | SetpointGlobal | SetpointAttitude,
        status: Status,
        here: Pose,
        now: int,
    ) -> bool:
        """Handle one set-point addressed to this vehicle that arrived at ``now`` (µs).

        Return whether the set-point is usable; whether it is followed depends on mode and activity.
        """
        reading = self._read(message, here)
        if not isinstance(reading, Setpoint):
            refusal = self._flavour.steering_refusal(status)
            self._status_text.complain(refusal or reading.reason, now)
            if isinstance(reading, Stop) and refusal is None and self._guidance.activity is Activity.TRACK:
                self._guidance.hold()
            return False
        self.stream = Stream(reading, now, self.stream.newest)
        refusal = self._flavour.steering_refusal(status)
        if refusal is None:
            self._follow(reading, here, now)
        elif refusal:
            self._status_text.complain(refusal, now)
        return True

    def resume(self, here: Pose, now: int) -> None:
        """Follow the newest set-point if the firmware accepts it from before GUIDED (PX4), else hold."""
        setpoint = self.stream.setpoint
        if self._flavour.stream_first and setpoint is not None:
            self._follow(setpoint, here, now)
        else:
            self._guidance.hold()

    def _read(self, message: SetpointLocal | SetpointGlobal | SetpointAttitude, here: Pose) -> Reading:
        if isinstance(message, SetpointAttitude):
            return self._flavour.read_attitude(message)
        if isinstance(message, SetpointGlobal):
            local = _localised(message, self._origin, self._home, stops=self._flavour.stops)
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
    return (here.position[2] if level == POSITION else 0.0) - z > _LIFT_OFF[level]


def _localised(
    message: SetpointGlobal, origin: Origin, home: Home, *, stops: bool
) -> SetpointLocal | Reading:
    """Return ``message`` as SET_POSITION_TARGET_LOCAL_NED (84) in frame 1, or the reason against it.

    ``stops``: an unknown frame means *stop*, as for ArduPilot; else the set-point is refused, as PX4 does.
    Without a position the frame does not matter: velocities are along north, east and down.
    """
    position = ZERO
    if message.type_mask & IGNORE_POSITION != IGNORE_POSITION:
        # Frames above terrain are not supported, because there is no terrain.
        if message.frame not in ABOVE_SEA | ABOVE_HOME:
            reason = f"frame {message.frame}"
            return Stop(f"Set-point stops: {reason}") if stops else Refusal(f"Set-point refused: {reason}")
        if not on_globe(message.x, message.y):
            return Refusal("Set-point refused: no such place on the globe")
        position = _position(message, origin, home)
    return SetpointLocal(
        message.source,
        message.time_boot,
        message.target_system,
        message.target_component,
        mavlink.MAV_FRAME_LOCAL_NED,
        message.type_mask,
        position,
        message.velocity,
        message.acceleration,
        message.yaw,
        message.yaw_rate,
    )


def _position(message: SetpointGlobal, origin: Origin, home: Home) -> Vector:
    """Return the position (m, local NED). A NaN altitude stays NaN; the set-point's check finds it."""
    above = home.altitude if message.frame in ABOVE_HOME else 0.0
    x, y, z = origin.local(message.x / 1e7, message.y / 1e7, origin.altitude)
    # The Earth's curvature: at equal altitude z is not zero.
    return x, y, z - (message.altitude + above - origin.altitude)
