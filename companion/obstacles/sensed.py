"""Obstacles from messages, beside those of the configuration and those that speak for themselves: what the
own sensors see, and traffic."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.config import CompanionConfig
from companion.obstacles.proximity import BODY, Proximity
from companion.obstacles.static import Axes
from companion.obstacles.traffic import FIRST_ID as TRAFFIC
from companion.obstacles.traffic import Traffic
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import AdsbVehicle, ObstacleDistance

_NEAR = 1e-6


class Stance(NamedTuple):
    """How the vehicle was at ``time`` (µs): its place (3,) m; where its nose pointed and where its north is,
    rad, counter-clockwise from the fleet's east. ``yaw`` is None where nobody knows."""

    time: int
    place: Array
    yaw: float | None
    north: float


class Sensed:
    """Of one vehicle. Without settings for a kind its messages are ignored."""

    def __init__(self, config: CompanionConfig, fleet: FleetFrame) -> None:
        self._config, self._fleet = config, fleet
        self.proximity = None if config.proximity is None else Proximity(config.proximity)
        self.traffic = None if config.traffic is None else Traffic(config.traffic)

    def receive_distances(self, now: int, message: ObstacleDistance, stance: Stance, known: Array) -> None:
        """OBSTACLE_DISTANCE of an own sensor, with the vehicle as it was when that was true; ``known`` (K,
        3): where neighbours are."""
        zero = stance.yaw if message.frame == BODY else stance.north
        if self.proximity is not None and zero is not None:
            self.proximity.receive(now, stance.time, message, stance.place, zero, known)

    def receive_traffic(self, now: int, message: AdsbVehicle, here: Array) -> None:
        """ADSB_VEHICLE, while the own vehicle is ``here`` (3,)."""
        if self.traffic is not None:
            height = self._fleet.altitude if message.altitude is None else message.altitude
            place = self._fleet.to_enu(message.latitude, message.longitude, height)
            self.traffic.receive(now, message, place, here)

    def around(self, now: int, prediction: Array, reach: float) -> Axes:
        """All of them within ``reach`` (m) of some predicted position (n, 3): the points nearest to these."""
        parts = [
            part.around(now, prediction, reach) for part in (self.proximity, self.traffic) if part is not None
        ]
        if not parts:
            return Axes((), np.empty((0, len(prediction), 3)), np.empty(0))
        ids, positions, radii = zip(*parts, strict=True)
        return Axes(sum(ids, ()), np.concatenate(positions), np.concatenate(radii))

    def obstacles(self, now: int, prediction: Array, reach: float) -> Obstacles:
        """The same as the field sees them, (n, 3) the own prediction.

        Deep in the room of traffic the field would push with all that the vehicle has, over any limit of
        speed. So that room ends, for the field, where it pushes gently; ``aside`` leads out of it.
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
        """The ``goal`` (3,), or a place nearby where the vehicle, which is ``here`` (3,), is in the way of no
        traffic."""
        if self.traffic is None or not len(self.traffic):
            return goal
        field = self._config.field
        return self.traffic.outside(now, goal, here, field.d_safe + field.margin(1))
