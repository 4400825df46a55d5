"""Follow modes: station keeping relative to a leader that reports its position.

The leader sends FOLLOW_TARGET (144) or GLOBAL_POSITION_INT (33).
"""

from __future__ import annotations

import math
from typing import Final

from mavlink_bridge.messages import FollowTarget, GlobalPosition, Vector
from sitl.autopilot.guidance import Activity, Guidance
from sitl.config.autonomy import FollowConfig
from sitl.values.home import Home
from sitl.values.origin import Origin
from sitl.values.setpoints import POSITION, ZERO, Pose, Setpoint, rotated

# Speed (m/s) below which the leader has no course.
_MIN_COURSE_SPEED: Final = 0.3
# Distance (m) below which there is no bearing to turn to.
_MIN_BEARING_DISTANCE: Final = 1.0
# PX4 has no limit of its own; a leader at a greater distance (m) is treated as corrupt data.
_MAX_DISTANCE: Final = 1000.0
_POSITION_LEVELS: Final = (POSITION, POSITION, POSITION)


class Following:
    """Station keeping on the leader; without one the vehicle holds."""

    def __init__(
        self, guidance: Guidance, origin: Origin, home: Home, config: FollowConfig, *, px4: bool
    ) -> None:
        """Set the rules of the firmware.

        ``px4``: FOLLOW_TARGET from any sender counts, GLOBAL_POSITION_INT does not, and the station is given
        by distance, angle and height. Otherwise both count if they come from the chosen system (0: the first
        sender), and the station is an offset.
        """
        self._guidance = guidance
        self._origin = origin
        self._home = home
        self._px4 = px4
        self._offset: Vector | None = None
        self._course = 0.0
        self._received = -math.inf
        self._config = config
        self._system = round(config.system)

    def configure(self, config: FollowConfig) -> None:
        """Use new settings from now on."""
        if config != self._config:
            self._config = config
            self._system = round(config.system)
            self._offset = None

    def choose(self, system: int) -> None:
        """Execute DO_FOLLOW (32): follow ``system`` from now on."""
        self._system = system
        self._offset = None

    def begin(self) -> None:
        """Hold until the leader's position arrives."""
        self._guidance.hold()
        self._offset = None
        self._received = -math.inf

    def receive(self, message: FollowTarget | GlobalPosition, here: Pose, now: int) -> None:
        """Follow a position report received at ``now`` (µs).

        A report is ignored if it does not come from the leader, or if the leader is out of range.
        """
        if not self._is_from_leader(message):
            return
        self._system = self._system or message.source.system
        there, velocity = self._motion(message)
        if math.dist(there, here.position) > (_MAX_DISTANCE if self._px4 else self._config.limit):
            return
        self._received = now
        station = self._station(there, message, velocity, here)
        north, east = there[0] - here.position[0], there[1] - here.position[1]
        yaw = math.atan2(east, north) if math.hypot(north, east) > _MIN_BEARING_DISTANCE else None
        setpoint = Setpoint(_POSITION_LEVELS, station, velocity, yaw=yaw, complete=True)
        self._guidance.track(setpoint, now, None, here, now)

    def advance(self, now: int) -> None:
        """Hold if no usable report came for ``patience`` seconds; call this in each step at ``now`` (µs)."""
        lost = now - self._received > self._config.patience * 1e6
        if lost and self._guidance.activity is Activity.TRACK:
            self._guidance.hold()

    def _is_from_leader(self, message: FollowTarget | GlobalPosition) -> bool:
        if self._px4:
            return isinstance(message, FollowTarget)
        return self._system in (0, message.source.system)

    def _motion(self, message: FollowTarget | GlobalPosition) -> tuple[Vector, Vector]:
        """Return position (m) and velocity (m/s), local NED.

        GLOBAL_POSITION_INT: the leader's height above its home is applied above the own home, as with the
        default of ArduPilot's FOLL_ALT_TYPE; FOLLOW_TARGET: the altitude above sea level counts.
        """
        x, y, z = self._origin.local(message.latitude, message.longitude, message.altitude)
        if isinstance(message, GlobalPosition):
            z = -(self._home.height + message.relative_altitude)
            return (x, y, z), message.velocity_ned
        return (x, y, z), message.velocity or ZERO

    def _station(
        self, there: Vector, message: FollowTarget | GlobalPosition, velocity: Vector, here: Pose
    ) -> Vector:
        config = self._config
        if math.hypot(velocity[0], velocity[1]) > _MIN_COURSE_SPEED:
            self._course = math.atan2(velocity[1], velocity[0])
        if self._px4:
            bearing = self._course + math.radians(config.angle)
            x, y = config.distance * math.cos(bearing), config.distance * math.sin(bearing)
            return there[0] + x, there[1] + y, -(self._home.height + config.height)
        offset = (config.x, config.y, config.z)
        if offset == ZERO:
            if self._offset is None:
                self._offset = _minus(here.position, there)
            offset = self._offset
        elif config.axes == "heading":
            yaw = message.yaw if isinstance(message, GlobalPosition) else None
            offset = rotated(offset, self._course if yaw is None else yaw)
        return there[0] + offset[0], there[1] + offset[1], there[2] + offset[2]


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
