"""What the own vehicle's distance sensors see (OBSTACLE_DISTANCE): posts that stand for a short while.

A return says that something is at its range, somewhere in its sector. It becomes a post that holds the arc of
the sector at that range, at every height, for nothing is known of heights. Returns that lie close together
are one post, which is that much larger. So every return of the last ``age_us`` lies inside a post; behind it,
and where nothing looks, nothing is known. A sensor that tilts with the vehicle is taken as if it were level.
"""

from __future__ import annotations

from math import pi, sin
from typing import NamedTuple

import numpy as np

from companion.config.obstacles import ProximityConfig
from companion.obstacles.static import Axes
from companion.values.horizon import Array
from mavlink_bridge.messages import ObstacleDistance, Source

FIRST_ID = 10_000
"""Ids of posts begin here: above those of fixed obstacles."""
BODY = 12
"""MAV_FRAME_BODY_FRD: the angles count from the nose."""
_NORTH = (0, 1)
"""MAV_FRAME_GLOBAL and MAV_FRAME_LOCAL_NED: from north."""
_SENSORS = 8
"""So many are listened to, and as many messages within ``_OFTEN``."""
_OFTEN = 20_000
"""µs; what one sensor says sooner after its last, of the same sectors, is passed over."""
_LEAST_SECTOR = 1e-3
"""rad."""


class Returns(NamedTuple):
    """Directions (k,), rad clockwise from where the angles of a message begin, and ranges (k,), m, of what is
    there, nearest first."""

    angles: Array
    ranges: Array


class _Look(NamedTuple):
    """Who says it, and of which sectors: a component may have several sensors of one type."""

    source: Source
    sensor: int
    frame: int
    offset: float
    increment: float


class _Post(NamedTuple):
    """Its id, its place (m, fleet-local ENU) and radius (m), and when it was seen last, µs."""

    id: int
    x: float
    y: float
    radius: float
    time: int

    def off(self, x: float, y: float) -> float:
        """Square of the distance from there, m²."""
        return (self.x - x) ** 2 + (self.y - y) ** 2


def returns(scan: ObstacleDistance, reach: float) -> Returns | None:
    """What is nearer than ``reach`` (m) and the sensor's own; None for a message that makes no sense.

    What is nearer than the sensor measures counts as at its least distance. Sectors beyond a full circle
    count for nothing.
    """
    width = abs(scan.increment)
    if not width >= _LEAST_SECTOR or not 0.0 <= scan.min_distance <= scan.max_distance > 0.0:
        return None
    if scan.frame != BODY and scan.frame not in _NORTH:
        return None
    count = min(len(scan.distances), int(2.0 * pi / width + 1e-6))
    distances = np.array([np.nan if one is None else one for one in scan.distances[:count]])
    there = np.flatnonzero(distances <= min(scan.max_distance, reach))
    ranges = np.maximum(distances[there], scan.min_distance)
    order = np.argsort(ranges, kind="stable")
    angles: Array = scan.offset + scan.increment * there[order].astype(np.float64)
    return Returns(angles, ranges[order])


class Proximity:
    """Of one vehicle. ``refused``: messages that made no sense, came from one sensor too many, or were more
    than eight within 20 ms."""

    def __init__(self, config: ProximityConfig) -> None:
        self._config = config
        self._posts: list[_Post] = []
        self._next_id = FIRST_ID
        self._heard: dict[tuple[Source, int], int] = {}
        self._lately: dict[_Look, int] = {}
        self.refused = 0

    def receive(
        self, now: int, when: int, scan: ObstacleDistance, place: Array, zero: float, known: Array
    ) -> None:
        """A message that arrived at ``now`` and was true at ``when`` (µs), with the vehicle at ``place`` (3,)
        then, and its angles counting clockwise from ``zero`` (rad, ENU); ``known`` (K, 3): where neighbours
        are."""
        sensor = scan.source, scan.sensor
        look = _Look(*sensor, scan.frame, scan.offset, scan.increment)
        self._lately = {one: heard for one, heard in self._lately.items() if now - heard < _OFTEN}
        if look in self._lately:
            return
        found = returns(scan, self._config.reach)
        full = len(self._lately) >= _SENSORS or (sensor not in self._heard and not self._room(now))
        if found is None or full:
            self.refused += 1
            return
        self._heard[sensor] = self._lately[look] = now
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
        """Those with their surface within ``reach`` (m) of some predicted position (n, 3), as high as
        that."""
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
        """Whether a sensor has been heard once, and none within ``age_us``."""
        return bool(self._heard) and now - max(self._heard.values()) > self._config.age_us

    def _room(self, now: int) -> bool:
        """For a sensor more: those that were last heard long ago make it."""
        if len(self._heard) >= _SENSORS:
            oldest = min(self._heard, key=self._heard.__getitem__)
            if now - self._heard[oldest] <= self._config.age_us:
                return False
            del self._heard[oldest]
        return True

    def _forget(self, now: int) -> None:
        self._posts = [post for post in self._posts if now - post.time <= self._config.age_us]

    def _take(self, when: int, points: Array, radii: Array) -> None:
        """Posts that are seen again go on with their ids, for methods remember on which side they pass one.
        Returns near one that this message has told of already are that one."""
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
