"""World picture from MAVLink alone: own vehicle, neighbours and target with ages, in the fleet frame."""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.target_source import FusedSource
from companion.estimation.camera_links import CAMERA_MESSAGES, CameraLinks, CameraMessage
from companion.estimation.fused_target import FusedTarget, Outgoing
from companion.estimation.fusion_log import FusionTally
from companion.estimation.origins import Origins
from companion.estimation.target import Target
from companion.estimation.time_sync import Answer
from companion.estimation.tracks import State, Track
from companion.obstacles.moving import MovingObstacles
from companion.obstacles.neighbours import Neighbours
from companion.obstacles.sensed import Sensed, SensorPose
from companion.obstacles.static import FixedObstacles
from companion.values.horizon import Array
from companion.values.mates import Sight
from companion.values.obstacles import Obstacles
from mavlink_bridge.frames import FleetFrame, LocalFrame
from mavlink_bridge.messages import (
    AdsbVehicle,
    Attitude,
    CameraTrackingGeo,
    GimbalAttitude,
    GlobalPosition,
    GpsGlobalOrigin,
    LocalPosition,
    Message,
    ObstacleDistance,
    Tunnel,
)

_ORIGIN = np.zeros(3)
_ORIGIN.flags.writeable = False
_MIN_COS_PITCH = 0.1
"""Lower bound of the cosine of the pitch in the yaw rate, which is undefined at ±90° of pitch."""


class View(NamedTuple):
    """World picture at one time: fleet-local ENU, SI; None where nothing has been received yet.

    ``yaw`` is ENU (rad, counter-clockwise from east); it is also None when it is older than
    ``guard.own_stale_us``. ``target`` is also None when its last measurement is older than
    ``guard.target_stale_us``. ``target_last`` is the target's last state at whatever age: a target that falls
    silent may still be there.
    """

    own: State | None
    yaw: float | None
    target: State | None
    local: LocalFrame | None
    target_last: State | None = None
    adrift: int = 0
    """Age (µs) of the last own position if it is from before the latest change of the frame; otherwise 0."""

    @property
    def own_age(self) -> int:
        """Age (µs) of the last own position, in the present or an earlier frame; 0 before the first."""
        return self.adrift if self.own is None else self.own.age


def reach(config: CompanionConfig) -> float:
    """Return the largest distance (m) from the own horizon at which an obstacle has an effect.

    It covers the field and the tangential band, both extended for closing at the largest speed of an axis.
    """
    field, band, speed = config.field, config.tangential, max(config.limits.fastest)
    stopping = 0.0 if field.braking is None else speed**2 / (2.0 * field.braking) + field.reaction * speed
    return field.d_safe + field.margin(1) + max(stopping, band.d_band + band.reach_s * speed)


class World:
    """World picture of one companion: takes messages by link, and gives a view at any later time."""

    def __init__(self, config: CompanionConfig, system: int, target_system: int, fleet: FleetFrame) -> None:
        self.config = config
        self.fleet = fleet
        self.neighbours = Neighbours(config, system, fleet)
        self._system = system
        self._target_system = target_system
        self._own = Track(config.own)
        source = config.target_source
        self.target: Target | FusedTarget
        self.cameras: CameraLinks | None = None
        if isinstance(source, FusedSource):
            self.target = fused = FusedTarget(config, source, system, fleet)
            self.cameras = CameraLinks(source, fleet, fused)
        else:
            self.target = Target(config, system, target_system, fleet)
        self.sensed = Sensed(config, fleet)
        self._fixed = FixedObstacles(config.obstacles)
        self._moving = MovingObstacles(config.moving)
        self._reach = reach(config)
        self._local: LocalFrame | None = None
        self._origin: tuple[float, float, float] | None = None
        self._origins = Origins()
        self._yaw: float | None = None
        self._yaw_time = 0
        self._yaw_rate = 0.0
        self._last_in_old_frame: State | None = None
        self._last_position_at = 0
        # Totals of the tracks in the earlier frames.
        self._clock_steps = self._clock_lost = 0
        self.moves = 0
        """Number of times that the autopilot's origin has changed after a position was received."""
        self.displaced = 0.0
        """Jump (m) of the own position in the fleet frame at the last such change; it should be 0."""
        self.doubt = 0.0
        """Distance (m) by which the own position may be wrong, beyond the usual error; enlarges obstacles."""
        self.stamp = 0
        """Last time stamp (µs since boot) of the own autopilot; 0 before the first."""

    def receive(self, now: int, link: str, message: Message) -> None:
        """Receive one message from ``link``; a message that does not concern the picture is ignored."""
        if link == "swarm" and isinstance(message, GlobalPosition):
            self.neighbours.receive_position(now, message)
            if isinstance(self.target, FusedTarget):
                self.target.heard(now, message.source, message.time_boot)
        elif link == "swarm" and isinstance(message, Tunnel):
            self.neighbours.receive_plan(now, message)
        elif self.cameras is not None and isinstance(message, CAMERA_MESSAGES):
            self._receive_camera(now, link, message)
        elif self.cameras is not None and isinstance(message, GimbalAttitude):
            self._receive_gimbal(now, message)
        elif isinstance(self.target, Target) and (link == "target" or isinstance(message, CameraTrackingGeo)):
            self.target.receive(now, link, message)
        elif isinstance(message, ObstacleDistance):
            self._receive_distances(now, message)
        elif isinstance(message, AdsbVehicle):
            own = self._own.at(now)
            self.sensed.receive_traffic(now, message, _ORIGIN if own is None else own.position)
        elif link == "autopilot" and message.source.system == self._system:
            self._receive_own(now, message)

    def forwards(self, now: int) -> list[Outgoing]:
        """Return the own detections to forward at ``now`` (µs), one in ``rates.detection_us`` at most."""
        if not isinstance(self.target, FusedTarget):
            return []
        return self.target.outgoing(now)

    @property
    def fusion(self) -> FusionTally | None:
        """Counters and log of the fusion of detections; None without it."""
        return self.target.tally if isinstance(self.target, FusedTarget) else None

    def shed(self) -> None:
        """Empty the log of the fusion of detections."""
        if isinstance(self.target, FusedTarget):
            self.target.shed()

    def sight(self, now: int, ahead: float) -> Sight:
        """Return what is known of the target beside its state; ``ahead`` (s): from ``now`` (µs) on."""
        return self.target.sight(now, ahead) if isinstance(self.target, FusedTarget) else Sight()

    @property
    def origin(self) -> tuple[float, float, float] | None:
        """The autopilot's origin: latitude and longitude (deg), altitude (m); None before it is received."""
        return self._origin

    def at(self, now: int) -> View:
        """Return the view at ``now`` (µs)."""
        yaw = self._yaw if now - self._yaw_time <= self.config.guard.own_stale_us else None
        if isinstance(self.target, FusedTarget):
            self.target.record(now)
        own, last = self._own.at(now), self.target.last(now)
        adrift = now - self._last_position_at if own is None and self._last_in_old_frame is not None else 0
        return View(own, yaw, self.target.fresh(last), self._local, last, adrift)

    @property
    def simulated(self) -> bool:
        """Whether the autopilot's clock is a simulation's, which may stop for a moment."""
        return self._own.brief

    @simulated.setter
    def simulated(self, value: bool) -> None:
        # The neighbours' clocks follow the same simulation's clock, each as it observes it.
        self._own.brief = self.neighbours.brief = value

    @property
    def late(self) -> int:
        """Delay (µs) of the own autopilot's messages beyond what its clock and link explain."""
        return self._own.late

    @property
    def clock_lost(self) -> int:
        """Time (µs) that the autopilot's clock has lost against the own clock, by its TIMESYNC answers."""
        return self._clock_lost + self._own.clock_lost

    def answered(self, now: int, answer: Answer) -> None:
        """Process an answer of the own autopilot about the time on its clock."""
        self._own.answered(now, *answer)

    @property
    def clock_steps(self) -> int:
        """Number of times that the autopilot's clock was re-synchronised, in all frames."""
        return self._clock_steps + self._own.clock_steps

    def obstacles(self, now: int, view: View, prediction: Array) -> Obstacles:
        """Return the obstacles near the own ``prediction`` (N + 1, 3), m, aligned with ``now + n·dt``.

        They are neighbours and other moving obstacles, the target where it is configured as an obstacle, and
        fixed and sensed obstacles near the prediction. All distances are enlarged by ``doubt``.
        """
        config, field = self.config, self.config.field
        places = None
        if config.avoidance != "certified":
            # A plan begins on the last plan, or at the vehicle if the vehicle has left the last plan.
            places = prediction[:1]
            if view.own is not None:
                places = prediction[:2].copy()
                places[1] = view.own.position
        obstacles = self.neighbours.obstacles(now, places)
        if len(self._moving):
            margins = field.margin(1), field.margin(2)
            obstacles = self._moving.among(obstacles, prediction, field.d_min, field.d_safe, *margins)
        target = view.target_last
        if target is not None and config.target_d_min is not None and config.target_d_safe is not None:
            ahead: Array = 1e-6 * config.horizon.dt_us * np.arange(config.horizon.steps + 1.0)
            moving = target.ahead(ahead).positions
            margin = np.array([field.margin(2)])
            obstacles = obstacles.joined(
                Obstacles(
                    (self._target_system,),
                    moving[None],
                    config.target_d_min + margin,
                    config.target_d_safe + margin,
                    margin,
                )
            )
        if len(self._fixed):
            ids, positions, radius = self._fixed.around(prediction, self._reach)
            radius = radius + field.margin(1)
            obstacles = obstacles.joined(
                Obstacles(ids, positions, field.d_min + radius, field.d_safe + radius, radius)
            )
        if config.proximity is not None or config.traffic is not None:
            obstacles = obstacles.joined(self.sensed.obstacles(now, prediction, self._reach))
        if self.doubt:
            further = self.doubt
            obstacles = obstacles._replace(
                d_min=obstacles.d_min + further,
                d_safe=obstacles.d_safe + further,
                radius=obstacles.radius + further,
            )
        return obstacles

    def _receive_camera(self, now: int, link: str, message: CameraMessage) -> None:
        """Process a message of the own camera, or one that a neighbour forwards, about a detection."""
        if self.cameras is None:
            return
        system = message.source.system
        if link == "swarm":
            self.cameras.forwarded(now, message, lambda stamp: self.neighbours.when(system, now, stamp))
        else:
            self.cameras.own(
                now, message, lambda stamp: self._own.dated(now, stamp), lambda: self._own.at(now)
            )

    def _receive_gimbal(self, now: int, message: GimbalAttitude) -> None:
        """Process a gimbal's attitude, dated by its stamp only if the autopilot itself sends it.

        Another component's stamps may be of a boot clock of its own.
        """
        if self.cameras is None:
            return
        by_autopilot = message.source.component == mavlink.MAV_COMP_ID_AUTOPILOT1
        self.cameras.turned(self._own.when(now, message.time_boot) if by_autopilot else now, message)

    def _receive_distances(self, now: int, message: ObstacleDistance) -> None:
        """Process an OBSTACLE_DISTANCE of the own system, with the vehicle's pose at measurement time."""
        config, own, local = self.config, self._own.at(now), self._local
        if config.proximity is None or message.source.system != self._system:
            return
        if own is None or local is None or own.age > config.guard.own_stale_us:
            return
        when = now - config.proximity.delay_us
        if message.source.component == mavlink.MAV_COMP_ID_AUTOPILOT1:
            stamped = self._own.when(now, message.time)
            when = stamped if now - config.proximity.age_us <= stamped <= now else when
        place = own.position - 1e-6 * (now - when) * own.velocity
        yaw, since = self._yaw, when - self._yaw_time
        if yaw is not None and abs(since) <= config.guard.own_stale_us:
            yaw += 1e-6 * since * self._yaw_rate
        else:
            yaw = None
        most = config.neighbour.extrapolate_us
        known = np.array(
            [x + 1e-6 * min(when - time, most) * v for _, time, x, v in self.neighbours.last_received()]
        ).reshape(-1, 3)
        self.sensed.receive_distances(
            now, message, SensorPose(when, place, yaw, local.yaw_to_fleet(0.0)), known
        )

    def _receive_own(self, now: int, message: Message) -> None:
        """Process a position, attitude or origin of the own autopilot."""
        if isinstance(message, LocalPosition):
            self.stamp = message.time_boot
            if self._local is not None:
                place, velocity = self._local.motion_to_fleet(message.position_ned, message.velocity_ned)
                self._own.measure(now, place, velocity, message.time_boot)
                if self._last_in_old_frame is not None:
                    self.moves += 1
                    self.displaced = float(np.linalg.norm(place - self._last_in_old_frame.position))
                    self._last_in_old_frame = None
        elif isinstance(message, Attitude):
            self.stamp = message.time_boot
            if self.cameras is not None:
                self.cameras.turned(self._own.when(now, message.time_boot), message)
            if self._local is not None:
                self._yaw = self._local.yaw_to_fleet(message.yaw)
                self._yaw_time = self._own.when(now, message.time_boot)
                self._yaw_rate = _yaw_rate_of(message)
        elif isinstance(message, GpsGlobalOrigin):
            origin = (message.latitude, message.longitude, message.altitude)
            if self._origins.counts(now, message) and origin != self._origin:
                # If several origins arrive before a position, the state before the first of them is kept.
                if self._last_in_old_frame is None and (left := self._own.at(now)) is not None:
                    self._last_in_old_frame, self._last_position_at = left, now - left.age
                self._origin = origin
                self._local = self.fleet.local(*origin)
                self._clock_steps += self._own.clock_steps
                self._clock_lost += self._own.clock_lost
                # Positions in the old frame must not be flown to in the new one.
                simulated, self._own = self.simulated, Track(self.config.own)
                self.simulated = simulated


def _yaw_rate_of(attitude: Attitude) -> float:
    """Return the yaw rate, rad/s, counter-clockwise from above."""
    _, q, r = attitude.body_rates
    level = max(cos(attitude.pitch), _MIN_COS_PITCH)
    return -(q * sin(attitude.roll) + r * cos(attitude.roll)) / level
