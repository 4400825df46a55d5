"""Guidance: the current activity as a reference (idle, take off, go, follow set-points, hold, land).

All values are in the vehicle's own local NED. Every motion passes the shaper, so that none begins with a
step, and then, if so configured, a model of a firmware's response. With such a response, set-points that give
a position on all axes bypass the shaper, because the firmware's own position controller takes them unshaped.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Final

from mavlink_bridge.messages import Vector
from sitl.autopilot.position_control.airframe import Motion
from sitl.autopilot.response import response_of
from sitl.autopilot.shaper import Heading, Limits, Shaper
from sitl.config.autopilot import AutopilotConfig
from sitl.values.setpoints import POSITION, VELOCITY, ZERO, Pose, Setpoint

_STAY: Final = Setpoint((VELOCITY, VELOCITY, VELOCITY))
_FOR_EVER: Final = 1 << 62
_REACHED: Final = (0.05, 0.1)  # m, m/s


class Activity(Enum):
    """Current activity of the guidance. IDLE: no reference, motors off or idling."""

    IDLE = "idle"
    TAKEOFF = "takeoff"
    GO = "go"
    TRACK = "track"
    HOLD = "hold"
    LAND = "land"


_INTERRUPTIBLE: Final = (Activity.GO, Activity.TRACK, Activity.HOLD)


class Guidance:
    """One reference, advanced in steps of some ms.

    ``motion`` (SI, local NED) and ``yaw``, ``yaw_rate`` are the present reference. ``timed_out`` becomes true
    when no set-point has come within the time limit: the vehicle then brakes and holds, see ``_expire``.
    """

    def __init__(self, config: AutopilotConfig) -> None:
        self._limits: dict[Activity, Limits] = {}
        self._response = response_of(config)
        self.configure(config)
        self._shaper = Shaper()
        self._heading = Heading(config.max_yaw_rate, config.max_yaw_acceleration)
        self._setpoint = _STAY
        self._received = 0
        self._deadline = _FOR_EVER
        self._interrupted: tuple[Activity, Setpoint] | None = None
        self._commanded: Motion | None = None
        self.activity = Activity.IDLE
        self.timed_out = False

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on, except for the yaw limits, which stay those of the constructor."""
        limits = config.max_speed, config.max_acceleration, config.max_jerk
        gentle = config.gentle_acceleration, config.max_jerk
        self._config = config
        # The leg being flown keeps its own speed.
        going = self._limits.get(Activity.GO, Limits(config.waypoint_speed, *gentle))
        self._limits = {
            Activity.GO: Limits(going.speed, *gentle),
            Activity.TAKEOFF: Limits(config.takeoff_speed, *gentle),
            Activity.TRACK: Limits(*limits),
            Activity.HOLD: Limits(config.max_speed, *gentle),
            Activity.LAND: Limits(config.max_speed, *gentle),
        }
        if self._response is not None:
            self._response.configure(config)

    @property
    def motion(self) -> Motion:
        """Position, velocity and acceleration to track now."""
        if self._response is not None:
            return self._response.motion
        shaper = self._shaper
        return shaper.position, shaper.velocity, shaper.acceleration

    @property
    def commanded(self) -> Motion:
        """Motion requested now by set-points that bypass the shaper; otherwise ``motion``."""
        return self._commanded if self._commanded is not None and self._unshaped else self.motion

    @property
    def yaw(self) -> float:
        """Yaw to track now (rad)."""
        return self._heading.yaw

    @property
    def yaw_rate(self) -> float:
        """Yaw rate to track now (rad/s)."""
        return self._heading.yaw_rate

    @property
    def reached(self) -> bool:
        """Whether a takeoff has reached its height and is nearly at rest.

        A firmware's response that lags behind the shaper is not considered.
        """
        gap = self._setpoint.position[2] - self._shaper.position[2]
        return abs(gap) < _REACHED[0] and math.hypot(*self._shaper.velocity) < _REACHED[1]

    def wanted(self, now: int) -> Setpoint:
        """Return the set-point to follow at ``now`` (µs), for the activities GO and TRACK.

        The destination of GO is returned unchanged. A set-point that bypasses the shaper is not limited, and
        extrapolated for ArduPilot only. Other set-points are extrapolated and limited.
        """
        config = self._config
        age = (now - self._received) * 1e-6
        if self.activity is Activity.GO:
            return self._setpoint
        if self._unshaped:
            # ArduPilot extrapolates a set-point until its time-out; PX4 keeps it unchanged.
            return self._setpoint.after(age if config.flavour == "ardupilot" else 0.0, math.inf)
        return self._setpoint.after(age, config.thrusting).limited(config.max_speed, config.max_acceleration)

    def idle(self) -> None:
        """Track no reference."""
        self.activity = Activity.IDLE
        self._interrupted = None

    def takeoff(self, height: float, here: Pose) -> None:
        """Climb vertically to ``height`` (m above the origin).

        In this and the following methods ``here`` is the pose at which the reference begins if there is none.
        """
        self._leave_ground(here)
        x, y, _ = self._shaper.position
        self._begin(Activity.TAKEOFF, Setpoint((POSITION, POSITION, POSITION), (x, y, -height)))

    def go(
        self, position: Vector, speed: float, yaw: float | None, here: Pose, through: Vector = ZERO
    ) -> None:
        """Fly to ``position`` (m) at up to ``speed`` (m/s), facing ``yaw`` (rad; None keeps the yaw).

        ``through`` is the velocity (m/s) there; unless zero, the next destination has to follow in time.
        """
        self._leave_ground(here)
        gentle = self._config.gentle_acceleration, self._config.max_jerk
        self._limits[Activity.GO] = Limits(speed, *gentle)
        self._begin(Activity.GO, Setpoint((POSITION, POSITION, POSITION), position, through, yaw=yaw))

    def track(self, setpoint: Setpoint, received: int, timeout: int | None, here: Pose, now: int) -> None:
        """Follow ``setpoint``, valid at the time ``received`` (µs), for ``timeout`` µs (None: no limit)."""
        self._leave_ground(here)
        self._received = received
        self._deadline = _FOR_EVER if timeout is None else received + timeout
        if self._interrupted is not None:
            self._interrupted = Activity.TRACK, setpoint
            return
        self._begin(Activity.TRACK, setpoint)
        if self._unshaped:
            return
        # With a step of zero length, a set-point that the shaper passes through takes effect without delay.
        self._shaper.advance(self.wanted(now), self._limits[Activity.TRACK], 0.0)

    def set_speed(self, speed: float) -> None:
        """Set the speed of the current flight to a destination to ``speed`` (m/s) from now on."""
        if self.activity is Activity.GO or (self._interrupted and self._interrupted[0] is Activity.GO):
            self._limits[Activity.GO] = self._limits[Activity.GO]._replace(speed=speed)

    def turn_to(self, yaw: float) -> None:
        """Turn to ``yaw`` (rad), until another activity or set-point begins."""
        self._setpoint = self._setpoint._replace(yaw=yaw, yaw_rate=None)

    @property
    def paused(self) -> bool:
        """Whether a ``pause`` is in effect."""
        return self._interrupted is not None

    def pause(self) -> bool:
        """Brake and hold.

        ``go_on`` resumes the present activity, or the latest set-point received by ``track`` in the meantime.
        Returns False if there is nothing to interrupt.
        """
        if self._interrupted is None and self.activity in _INTERRUPTIBLE:
            interrupted = self.activity, self._setpoint
            self.hold()
            self._interrupted = interrupted
        return self.paused

    def go_on(self) -> None:
        """End ``pause``."""
        if self._interrupted is not None:
            activity, setpoint = self._interrupted
            self._begin(activity, setpoint)

    def hover(self, here: Pose) -> None:
        """Brake and hold; without a reference, begin one at rest ``here``."""
        self._leave_ground(here)
        self.hold()

    def hold(self) -> None:
        """Brake, and hold at the stopping point."""
        self._begin(Activity.HOLD, _STAY)

    def end_takeoff(self) -> None:
        """Hold at the end of the takeoff."""
        self.activity = Activity.HOLD

    def land(self, speed: float) -> None:
        """Brake, and sink at ``speed`` (m/s)."""
        self._begin(Activity.LAND, _STAY._replace(velocity=(0.0, 0.0, speed)))

    def relocate(self, position: Vector, velocity: Vector) -> None:
        """Move the tracked reference to ``position`` (m) and ``velocity`` (m/s).

        Call it after the position estimate has jumped. A takeoff continues vertically above the new position;
        other set-points keep their values, and are approached within the limits.
        """
        if self.activity is Activity.IDLE:
            return
        shaper = self._shaper
        if self.activity is Activity.TAKEOFF:
            z = self._setpoint.position[2]
            self._setpoint = self._setpoint._replace(position=(position[0], position[1], z))
        shaper.position, shaper.velocity, shaper.captured = position, velocity, False
        if self._response is not None:
            self._response.relocate(position, velocity)

    def advance(self, now: int, step: int, wind: Vector = ZERO, drift: Vector = ZERO) -> None:
        """Advance the reference from ``now`` to ``now + step`` (µs).

        ``wind`` (m/s) is the velocity of the air. The estimated position moves by ``drift`` (m/s) more than
        the estimated velocity indicates.
        """
        activity = self.activity
        if activity is Activity.IDLE:
            return
        end = now + step
        dt = step * 1e-6
        if activity is Activity.TRACK:
            if end > self._deadline:
                self._expire(self.wanted(self._deadline))
            wanted = self.wanted(end)
        else:
            wanted = self._setpoint
            if activity is Activity.HOLD and wanted.yaw is None and self._resting:
                return
        self._heading.advance(wanted.yaw, wanted.yaw_rate, dt)
        shaper, response = self._shaper, self._response
        if response is not None and self._unshaped:
            self._commanded = wanted.position, wanted.velocity, wanted.acceleration
            response.advance(self._commanded, dt, wind, drift)
            # The activity after the stream begins on the trajectory that the firmware derives from it.
            shaper.position, shaper.velocity, shaper.acceleration = response.desired
            return
        shaper.advance(wanted, self._limits[self.activity], dt)
        if response is not None:
            response.advance((shaper.position, shaper.velocity, shaper.acceleration), dt, wind, drift)

    def _expire(self, last: Setpoint) -> None:
        """Brake and hold after set-points have ceased.

        With a model of its response, ArduPilot discards the commanded velocity but keeps the commanded
        position, extrapolated to the time-out; the vehicle returns to this position.
        """
        persists = self._response is not None and self._config.flavour == "ardupilot"
        if persists and last.levels[0] == POSITION:
            self._shaper.restart(last.position)
        self.hold()
        self.timed_out = True

    @property
    def _unshaped(self) -> bool:
        """Whether the firmware's own position controller receives the set-points unshaped."""
        return (
            self._response is not None
            and self.activity is Activity.TRACK
            and self._setpoint.levels == (POSITION, POSITION, POSITION)
        )

    @property
    def _resting(self) -> bool:
        """Whether nothing would move; a firmware's response never comes fully to rest."""
        return self._shaper.at_rest and self._heading.yaw_rate == 0.0 and self._response is None

    def _begin(self, activity: Activity, setpoint: Setpoint) -> None:
        self.activity = activity
        self.timed_out = False
        self._interrupted = None
        self._setpoint = setpoint

    def _leave_ground(self, here: Pose) -> None:
        if self.activity is Activity.IDLE:
            self._shaper.restart(here.position)
            if self._response is not None:
                self._response.restart(here.position)
            self._heading.restart(here.yaw)
