"""Other traffic, as an ADS-B receiver tells of it (ADSB_VEHICLE): balls that fly straight on.

It gives way to nobody, and is much faster than those who see it. So it is not the ball of now that is kept
away from but all the way that it flies in the next ``ahead_us``: who is near that goes aside, not along. What
it does beyond flying straight on is seen with its next message. Its height is known only within
``height_error``, by pressure or by another geoid than ours; it counts as at the nearest height within that.
"""

from __future__ import annotations

from math import cos, hypot, inf, sin
from typing import NamedTuple

import numpy as np

from companion.config.obstacles import _ADDRESSES, TrafficConfig
from companion.obstacles.static import Axes
from companion.values.horizon import Array
from mavlink_bridge.messages import AdsbVehicle

FIRST_ID = 1 << 32
"""Ids of traffic: above all others."""
_FASTEST, _CLIMBS = 350.0, 60.0
"""m/s; beyond these, and beyond ``_HIGHEST`` (m), it is garbage."""
_HIGHEST = 30_000.0
_STRAYS = 300.0
"""m; one address that is further off than flying explains is two, and the first one counts."""
_HEAD_ON = 1.0
"""m; so near to its way it does not say to which side to go, and one goes to its right."""
_NEAR = 1e-6
_EAST = np.array([1.0, 0.0])


class _Aircraft(NamedTuple):
    """It was at ``place`` (3,) m with ``velocity`` (3,) m/s at ``when`` (µs), ± ``half`` (m) in height."""

    when: int
    place: Array
    velocity: Array
    half: float


class Traffic:
    """All that is heard, by address. ``refused``: messages that made no sense, or were beyond what counts."""

    def __init__(self, config: TrafficConfig) -> None:
        self._config = config
        self._heard: dict[int, _Aircraft] = {}
        self.refused = 0

    def __len__(self) -> int:
        return len(self._heard)

    def receive(self, now: int, message: AdsbVehicle, place: Array, here: Array) -> bool:
        """A message that arrived at ``now`` (µs), of traffic at ``place`` (3,) m, fleet-local ENU, while the
        own vehicle is ``here`` (3,); whether it counts."""
        self._forget(now)
        taken = message.address not in self._config.ignore and self._take(now, message, place, here)
        self.refused += not taken
        return taken

    def around(self, now: int, prediction: Array, reach: float) -> Axes:
        """The nearest points of the ways of those whose room begins within ``reach`` (m) of some predicted
        position (n, 3)."""
        self._forget(now)
        ids, positions = [], []
        for address, one in self._heard.items():
            nearest = self._nearest(now, one, prediction)
            off = nearest - prediction
            if (np.vecdot(off, off) <= (reach + self._config.radius) ** 2).any():
                ids.append(FIRST_ID + address)
                positions.append(nearest)
        places = np.array(positions).reshape(-1, len(prediction), 3)
        return Axes(tuple(ids), places, np.full(len(ids), self._config.radius))

    def outside(self, now: int, goal: Array, here: Array, clearance: float) -> Array:
        """The ``goal`` (3,), or a place as high beside the ways that it lies on, ``clearance`` (m) beyond
        their room and on the side where the vehicle is: it flies there, and is not pushed."""
        room = self._config.radius + clearance
        for there, beside in self.around(now, np.stack([goal, here]), clearance).positions:
            off, own = goal - there, here - beside
            if off @ off < room**2:
                # Never up or down: below it may be the ground.
                ways = (own, off) if own @ own < room**2 else (off, own)
                way = next((way[:2] for way in ways if hypot(way[0], way[1]) > _NEAR), _EAST)
                goal = np.append(there[:2] + way * (room / hypot(way[0], way[1])), goal[2])
        return goal

    def _take(self, now: int, message: AdsbVehicle, place: Array, here: Array) -> bool:
        speed, climb = message.speed or 0.0, message.climb or 0.0
        off = place[:2] - here[:2]
        if message.address >= _ADDRESSES or speed > _FASTEST or abs(climb) > _CLIMBS:
            return False
        if message.age > self._config.age_us or not abs(place[2]) <= _HIGHEST:
            return False
        if not float(off @ off) <= self._config.reach**2:
            return False
        course = message.course
        flat = (0.0, 0.0) if course is None else (speed * sin(course), speed * cos(course))
        half = inf if message.altitude is None else self._config.height_error
        one = _Aircraft(now - message.age, place, np.array([*flat, climb]), half)
        before = self._heard.get(message.address)
        if before is not None:
            moved = place[:2] - before.place[:2]
            explained = _STRAYS + _FASTEST * 1e-6 * abs(one.when - before.when)
            if one.when < before.when or float(moved @ moved) > explained**2:
                return False
        elif len(self._heard) >= self._config.most and not self._make_room(off, here):
            return False
        self._heard[message.address] = one
        return True

    def _make_room(self, off: Array, here: Array) -> bool:
        """Whether the furthest of all goes for one that is ``off`` (2,) from ``here``."""
        far = {address: float(np.hypot(*(one.place - here)[:2])) for address, one in self._heard.items()}
        furthest = max(far, key=far.__getitem__)
        if far[furthest] <= float(np.hypot(*off)):
            return False
        del self._heard[furthest]
        return True

    def _nearest(self, now: int, one: _Aircraft, prediction: Array) -> Array:
        """The points (n, 3) of its way that are nearest to ``prediction`` (n, 3), seen from above."""
        begin = one.place + 1e-6 * (now - one.when) * one.velocity
        way = 1e-6 * self._config.ahead_us * one.velocity
        off = prediction - begin
        square = float(way[:2] @ way[:2])
        share = np.zeros(len(off)) if square < 1.0 else np.clip(off[:, :2] @ way[:2] / square, 0.0, 1.0)
        nearest = begin + share[:, None] * way
        nearest[:, 2] = np.clip(prediction[:, 2], nearest[:, 2] - one.half, nearest[:, 2] + one.half)
        aside = prediction - nearest
        level = np.abs(aside[:, 2]) < _HEAD_ON
        head_on = level & (np.vecdot(aside[:, :2], aside[:, :2]) < _HEAD_ON**2)
        if square >= 1.0 and head_on.any():
            left = np.array([-way[1], way[0], 0.0]) / np.sqrt(square)
            nearest[head_on] = prediction[head_on] + _HEAD_ON * left
        return nearest

    def _forget(self, now: int) -> None:
        for address in [a for a, one in self._heard.items() if now - one.when > self._config.age_us]:
            del self._heard[address]
