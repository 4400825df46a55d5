"""Obstacles seen by the own distance sensors (OBSTACLE_DISTANCE): posts with a short lifetime.

A return means that an object is at its range, somewhere in its sector. It becomes a post that covers the arc
of the sector at that range, at every height, because heights are unknown. Returns nearer to each other than
``spacing`` become one post; every post is enlarged by ``spacing``. So the returns of the last ``age_us`` lie
inside posts, of which the nearest ``most`` are kept; behind them, and outside the sensors' fields of view,
nothing is known. A sensor that tilts with the vehicle is treated as level.
"""

from __future__ import annotations

from math import pi, sin
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config.obstacles import ProximityConfig
from companion.obstacles.static import Axes
from companion.values.horizon import Array
from mavlink_bridge.messages import ObstacleDistance, Source

FIRST_ID = 1_000_000
"""Ids of posts begin here: above those of fixed obstacles."""
_FROM_NORTH = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_LOCAL_NED)
"""Frames in which angles are relative to north; in MAV_FRAME_BODY_FRD they are relative to the nose."""
_SENSORS = 8
"""Maximum number of sensors, and of messages within ``_MIN_INTERVAL_US``."""
_MIN_INTERVAL_US = 20_000
"""µs; least interval between two messages of one sensor about the same sectors; others are skipped."""
_LEAST_SECTOR = 1e-3
"""rad; least width of a sector."""


class Returns(NamedTuple):
    """Directions (k,), rad, and ranges (k,), m, of the returns, nearest first.

    Directions are clockwise from the zero direction of the message's angles.
    """

    angles: Array
    ranges: Array


class _Look(NamedTuple):
    """Sender and sectors of a message: a component may have several sensors of one type."""

    source: Source
    sensor: int
    frame: int
    offset: float
    increment: float


class _Post(NamedTuple):
    """A post: id, position (m, fleet-local ENU), radius (m), and the time when it was last seen, µs."""

    id: int
    x: float
    y: float
    radius: float
    time: int

    def off(self, x: float, y: float) -> float:
        """Return the square of the horizontal distance (m²) to the point (``x``, ``y``)."""
        return (self.x - x) ** 2 + (self.y - y) ** 2


def returns(scan: ObstacleDistance, reach: float) -> Returns | None:
    """Return the returns nearer than ``reach`` (m) and the sensor's range; None for an invalid message.

    Returns below the sensor's least distance are set to that distance. Sectors beyond a full circle are
    ignored.
    """
    width = abs(scan.increment)
    if not width >= _LEAST_SECTOR or not 0.0 <= scan.min_distance <= scan.max_distance > 0.0:
        return None
    if scan.frame not in (mavlink.MAV_FRAME_BODY_FRD, *_FROM_NORTH):
        return None
    count = min(len(scan.distances), int(2.0 * pi / width + 1e-6))
    distances = np.array([np.nan if one is None else one for one in scan.distances[:count]])
    there = np.flatnonzero(distances <= min(scan.max_distance, reach))
    ranges = np.maximum(distances[there], scan.min_distance)
    order = np.argsort(ranges, kind="stable")
    angles: Array = scan.offset + scan.increment * there[order].astype(np.float64)
    return Returns(angles, ranges[order])


class Proximity:
    """Posts from the distance sensors of one vehicle.

    ``refused`` counts messages that were invalid, came from a ninth sensor, or exceeded eight within 20 ms.
    """

    def __init__(self, config: ProximityConfig) -> None:
        self._config = config
        self._posts: list[_Post] = []
        self._next_id = FIRST_ID
        self._received: dict[tuple[Source, int], int] = {}
        self._lately: dict[_Look, int] = {}
        self.refused = 0

    def receive(
        self, now: int, when: int, scan: ObstacleDistance, place: Array, zero: float, known: Array
    ) -> None:
        """Receive a message that arrived at ``now`` and was true at ``when`` (µs).

        ``place`` (3,): the vehicle's position then; ``zero`` (rad, ENU): the direction from which the
        message's angles count clockwise; ``known`` (K, 3): positions of neighbours, whose returns are
        ignored.
        """
        sensor = scan.source, scan.sensor
        look = _Look(*sensor, scan.frame, scan.offset, scan.increment)
        self._lately = {
            one: received for one, received in self._lately.items() if now - received < _MIN_INTERVAL_US
        }
        if look in self._lately:
            return
        found = returns(scan, self._config.reach)
        full = len(self._lately) >= _SENSORS or (sensor not in self._received and not self._room(now))
        if found is None or full:
            self.refused += 1
            return
        self._received[sensor] = self._lately[look] = now
        direction = zero - found.angles
        points = place[:2] + found.ranges[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
        arcs = 2.0 * found.ranges * sin(0.25 * min(abs(scan.increment), 2.0 * pi))
        off = np.column_stack([points, np.full(len(points), place[2])])[:, None] - known[None]
        strange = (np.vecdot(off, off) >= self._config.known**2).all(axis=1)
        self._forget(now)
        self._take(when, points[strange], arcs[strange] + self._config.spacing)
        x, y, _ = place.tolist()
        self._posts.sort(key=lambda post: post.off(x, y))
        del self._posts[self._config.most :]

    def around(self, now: int, prediction: Array, reach: float) -> Axes:
        """Return the posts whose surface is within ``reach`` (m) of some ``prediction`` (n, 3), horizontally.

        The points of their axes are at the heights of the prediction.
        """
        self._forget(now)
        places = np.array([(post.x, post.y) for post in self._posts]).reshape(-1, 2)
        radii = np.array([post.radius for post in self._posts])
        off = prediction[None, :, :2] - places[:, None]
        near = np.flatnonzero((np.vecdot(off, off) <= (reach + radii[:, None]) ** 2).any(axis=1))
        positions = np.empty((len(near), len(prediction), 3))
        positions[..., :2] = places[near, None]
        positions[..., 2] = prediction[:, 2]
        return Axes(tuple(self._posts[row].id for row in near), positions, radii[near])

    def silent(self, now: int) -> bool:
        """Return whether any sensor has been received, but none within the last ``age_us``."""
        return bool(self._received) and now - max(self._received.values()) > self._config.age_us

    def _room(self, now: int) -> bool:
        """Return whether another sensor can be accepted.

        If there is no room, the sensor that has been silent longest is removed, provided that it has been
        silent for ``age_us``.
        """
        if len(self._received) >= _SENSORS:
            oldest = min(self._received, key=self._received.__getitem__)
            if now - self._received[oldest] <= self._config.age_us:
                return False
            del self._received[oldest]
        return True

    def _forget(self, now: int) -> None:
        self._posts = [post for post in self._posts if now - post.time <= self._config.age_us]

    def _take(self, when: int, points: Array, radii: Array) -> None:
        """Merge new returns into the posts.

        A post that is seen again keeps its id, because avoidance methods store on which side they pass it.
        A return near a post of the same message becomes part of that post.
        """
        old, new, near = self._posts, list[_Post](), self._config.spacing**2
        for (x, y), radius in zip(points.tolist(), radii.tolist(), strict=True):
            best = min(range(len(new)), key=lambda row: new[row].off(x, y), default=-1)
            if best >= 0 and new[best].off(x, y) < near:
                new[best] = new[best]._replace(radius=max(new[best].radius, radius))
                continue
            best = min(range(len(old)), key=lambda row: old[row].off(x, y), default=-1)
            if best >= 0 and old[best].off(x, y) < near:
                name = old.pop(best).id
            else:
                name, self._next_id = self._next_id, self._next_id + 1
            new.append(_Post(name, x, y, radius, when))
        self._posts = old + new
