"""Other traffic reported by an ADS-B receiver (ADSB_VEHICLE): spheres that fly straight on.

Traffic does not give way, and is much faster than the vehicles here. So the vehicle keeps away not from the
present sphere but from the whole path of the next ``ahead_us``, and a vehicle near that path moves to the
side of it, not along it. A deviation from the straight line shows only in the next message. The height is
known only within ``height_error``, because it is a pressure altitude or refers to another geoid; the nearest
height within that range is used.
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
"""Ids of traffic begin here: above all others."""
_MAX_SPEED, _MAX_CLIMB = 350.0, 60.0
"""m/s, largest speed and climb rate; reports beyond these or ``_MAX_HEIGHT`` (m) are rejected as invalid."""
_MAX_HEIGHT = 30_000.0
_JUMP_TOLERANCE = 300.0
"""m; tolerance on the distance between two positions of one address, beyond ``_MAX_SPEED`` · interval.

Positions further apart are attributed to two aircraft, and the first one is kept.
"""
_SIDE_OFFSET = 1.0
"""m; nearer to the path than this, the side is undefined: the vehicle evades to the aircraft's right."""
_NEAR = 1e-6
_EAST = np.array([1.0, 0.0])
_MIN_PATH_SQUARE = 1.0
"""Least square (m²) of the length of a path that has a direction."""


class _Aircraft(NamedTuple):
    """State at ``when`` (µs): ``place`` (3,) m, height error ± ``half`` (m), and ``velocity`` (3,) m/s."""

    when: int
    place: Array
    velocity: Array
    half: float


class _Path(NamedTuple):
    """Path of an aircraft: it begins at ``begin`` (3,), m, and leads along ``way`` (3,), m.

    ``half``: half of the range of heights (m) in which the aircraft may be.
    """

    begin: Array
    way: Array
    half: float

    @property
    def square(self) -> float:
        """Square of the length seen from above, m²."""
        return float(self.way[:2] @ self.way[:2])

    def nearest(self, points: Array) -> Array:
        """Return the path points (n, 3) that are nearest to ``points`` (n, 3), seen from above."""
        off, square = points - self.begin, self.square
        share = (
            np.zeros(len(off))
            if square < _MIN_PATH_SQUARE
            else np.clip(off[:, :2] @ self.way[:2] / square, 0.0, 1.0)
        )
        nearest = self.begin + share[:, None] * self.way
        nearest[:, 2] = np.clip(points[:, 2], nearest[:, 2] - self.half, nearest[:, 2] + self.half)
        return np.asarray(nearest)

    def across(self, side: Array) -> Array:
        """Return a horizontal direction (2,) at a right angle to the path, on the ``side`` (3,), m, of it."""
        if self.square < _MIN_PATH_SQUARE:
            return side[:2] if hypot(side[0], side[1]) > _NEAR else _EAST
        left = np.array([-self.way[1], self.way[0]])
        return left if left @ side[:2] >= 0.0 else -left


class Traffic:
    """All received aircraft, by address; ``refused`` counts all messages that were not accepted."""

    def __init__(self, config: TrafficConfig) -> None:
        self._config = config
        self._received: dict[int, _Aircraft] = {}
        self.refused = 0

    def __len__(self) -> int:
        return len(self._received)

    def receive(self, now: int, message: AdsbVehicle, place: Array, here: Array) -> bool:
        """Receive a message that arrived at ``now`` (µs); return whether it was accepted.

        The aircraft is at ``place`` (3,) m, the own vehicle at ``here`` (3,) m, both fleet-local ENU.
        """
        self._forget(now)
        taken = message.address not in self._config.ignore and self._take(now, message, place, here)
        self.refused += not taken
        return taken

    def around(self, now: int, prediction: Array, reach: float) -> Axes:
        """Return the nearest path points of all aircraft near the predicted positions (n, 3).

        Near means that the keep-out volume begins within ``reach`` (m) of some predicted position.
        """
        self._forget(now)
        ids, positions = [], []
        for address, one in self._received.items():
            nearest = self._nearest(now, one, prediction)
            off = nearest - prediction
            if (np.vecdot(off, off) <= (reach + self._config.radius) ** 2).any():
                ids.append(FIRST_ID + address)
                positions.append(nearest)
        places = np.array(positions).reshape(-1, len(prediction), 3)
        return Axes(tuple(ids), places, np.full(len(ids), self._config.radius))

    def outside(self, now: int, goal: Array, here: Array, clearance: float) -> Array:
        """Return the ``goal`` (3,), or a place of the same height beside the paths on which the goal lies.

        That place is ``clearance`` (m) outside their keep-out volumes, if possible on the vehicle's side: the
        vehicle flies there, and is not pushed by the field.
        """
        self._forget(now)
        room = self._config.radius + clearance
        for one in self._received.values():
            path = self._path(now, one)
            there, beside = path.nearest(np.stack([goal, here]))
            off, own = goal - there, here - beside
            if off @ off >= room**2:
                continue
            # Never up or down: there may be ground below. A direction that is not at a right angle to the
            # path may lead nearer to another point of it; the last one is at a right angle.
            for way in (own if own @ own < room**2 else off, path.across(here - there)):
                size = hypot(way[0], way[1])
                if size > _NEAR:
                    place = np.append(there[:2] + way[:2] * (room / size), goal[2])
                    if hypot(*(place - path.nearest(place[None])[0])[:2]) >= room - _NEAR:
                        goal = place
                        break
        return goal

    def _take(self, now: int, message: AdsbVehicle, place: Array, here: Array) -> bool:
        speed, climb = message.speed or 0.0, message.climb or 0.0
        off = place[:2] - here[:2]
        if message.address >= _ADDRESSES or speed > _MAX_SPEED or abs(climb) > _MAX_CLIMB:
            return False
        if message.age > self._config.age_us or not abs(place[2]) <= _MAX_HEIGHT:
            return False
        if not float(off @ off) <= self._config.reach**2:
            return False
        course = message.course
        flat = (0.0, 0.0) if course is None else (speed * sin(course), speed * cos(course))
        half = inf if message.altitude is None else self._config.height_error
        one = _Aircraft(now - message.age, place, np.array([*flat, climb]), half)
        before = self._received.get(message.address)
        if before is not None:
            moved = place[:2] - before.place[:2]
            explained = _JUMP_TOLERANCE + _MAX_SPEED * 1e-6 * abs(one.when - before.when)
            if one.when < before.when or float(moved @ moved) > explained**2:
                return False
        elif len(self._received) >= self._config.most and not self._make_room(off, here):
            return False
        self._received[message.address] = one
        return True

    def _make_room(self, off: Array, here: Array) -> bool:
        """Remove the aircraft furthest from ``here`` for a nearer one; return whether that was done.

        ``off`` (2,), m: position of the new one relative to ``here``.
        """
        far = {address: float(np.hypot(*(one.place - here)[:2])) for address, one in self._received.items()}
        furthest = max(far, key=far.__getitem__)
        if far[furthest] <= float(np.hypot(*off)):
            return False
        del self._received[furthest]
        return True

    def _path(self, now: int, one: _Aircraft) -> _Path:
        """Return the path of an aircraft from ``now`` on."""
        begin = one.place + 1e-6 * (now - one.when) * one.velocity
        return _Path(begin, 1e-6 * self._config.ahead_us * one.velocity, one.half)

    def _nearest(self, now: int, one: _Aircraft, prediction: Array) -> Array:
        """Return the path points (n, 3) that are nearest to ``prediction`` (n, 3), seen from above.

        For a prediction within 1 m of the path, the point is set 1 m beside the prediction, so that the field
        has a direction.
        """
        path = self._path(now, one)
        nearest = path.nearest(prediction)
        aside = prediction - nearest
        level = np.abs(aside[:, 2]) < _SIDE_OFFSET
        head_on = level & (np.vecdot(aside[:, :2], aside[:, :2]) < _SIDE_OFFSET**2)
        if path.square >= _MIN_PATH_SQUARE and head_on.any():
            left = np.array([-path.way[1], path.way[0], 0.0]) / np.sqrt(path.square)
            nearest[head_on] = prediction[head_on] + _SIDE_OFFSET * left
        return nearest

    def _forget(self, now: int) -> None:
        for address in [a for a, one in self._received.items() if now - one.when > self._config.age_us]:
            del self._received[address]
