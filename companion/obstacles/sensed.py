"""Obstacles from the own sensors and from traffic reports.

They supplement the configured obstacles and the moving ones that report their own positions.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.obstacles.proximity import Proximity
from companion.obstacles.static import Axes
from companion.obstacles.traffic import FIRST_ID as TRAFFIC
from companion.obstacles.traffic import Traffic
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import AdsbVehicle, ObstacleDistance

_NEAR = 1e-6


class SensorPose(NamedTuple):
    """Pose of the vehicle at ``time`` (µs): position (3,) m, and directions of nose and north, rad.

    The directions are counter-clockwise from the fleet's east. ``yaw`` is None where it is unknown.
    """

    time: int
    place: Array
    yaw: float | None
    north: float


class Sensed:
    """Sensed obstacles of one vehicle; messages of a kind without settings are ignored."""

    def __init__(self, config: CompanionConfig, fleet: FleetFrame) -> None:
        self._config, self._fleet = config, fleet
        self.proximity = None if config.proximity is None else Proximity(config.proximity)
        self.traffic = None if config.traffic is None else Traffic(config.traffic)

    def receive_distances(
        self, now: int, message: ObstacleDistance, stance: SensorPose, known: Array
    ) -> None:
        """Receive OBSTACLE_DISTANCE from an own sensor.

        ``stance``: the vehicle's pose when the message was true; ``known`` (K, 3): positions of neighbours.
        """
        zero = stance.yaw if message.frame == mavlink.MAV_FRAME_BODY_FRD else stance.north
        if self.proximity is not None and zero is not None:
            self.proximity.receive(now, stance.time, message, stance.place, zero, known)

    def receive_traffic(self, now: int, message: AdsbVehicle, here: Array) -> None:
        """Receive ADSB_VEHICLE, with the own vehicle at ``here`` (3,)."""
        if self.traffic is not None:
            height = self._fleet.altitude if message.altitude is None else message.altitude
            place = self._fleet.to_enu(message.latitude, message.longitude, height)
            self.traffic.receive(now, message, place, here)

    def around(self, now: int, prediction: Array, reach: float) -> Axes:
        """Return all sensed obstacles within ``reach`` (m) of some predicted position (n, 3).

        Each obstacle is given by its points nearest to the predicted positions.
        """
        if self.proximity is None and self.traffic is None:
            return _nothing(len(prediction))
        parts = [
            part.around(now, prediction, reach) for part in (self.proximity, self.traffic) if part is not None
        ]
        ids, positions, radii = zip(*parts, strict=True)
        return Axes(sum(ids, ()), np.concatenate(positions), np.concatenate(radii))

    def obstacles(self, now: int, prediction: Array, reach: float) -> Obstacles:
        """Return the obstacles of ``around`` for the field; ``prediction`` (n, 3): own predicted positions.

        Deep inside the keep-out volume of traffic the field would push with the full acceleration of the
        vehicle, beyond any speed limit. So for the field this volume is made smaller, such that the push is
        moderate; the goal from ``aside`` leads out of the volume.
        """
        ids, positions, radius = self.around(now, prediction, reach)
        field = self._config.field
        for row, name in enumerate(ids):
            if name >= TRAFFIC:
                off = positions[row, 0] - prediction[0]
                far = max(float(np.sqrt(off @ off)), _NEAR)
                spare = far - 0.5 * (field.d_min + field.d_safe) - field.margin(1)
                radius[row] = min(max(spare, 0.0), radius[row])
                positions[row] += max(-spare, 0.0) / far * off
        radius = radius + field.margin(1)
        return Obstacles(ids, positions, field.d_min + radius, field.d_safe + radius, radius)

    def aside(self, now: int, goal: Array, here: Array) -> Array:
        """Return the ``goal`` (3,), or a place nearby that is clear of all traffic.

        ``here`` (3,) is the position of the vehicle.
        """
        if self.traffic is None or not len(self.traffic):
            return goal
        field = self._config.field
        return self.traffic.outside(now, goal, here, field.d_safe + field.margin(1))


@cache
def _nothing(points: int) -> Axes:
    """Return no obstacle, beside so many predicted positions."""
    return Axes((), np.empty((0, points, 3)), np.empty(0))
