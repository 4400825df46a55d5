"""Obstacles of ways and goals: fixed ones, and vehicles that rest or have landed.

Seen from above they are discs and rectangles, in space balls. Plans keep clear of what moves, too
(``ConstraintSources``).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, sqrt

import numpy as np

from companion.avoidance.certified.departed import DepartedVehicles
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.peers import Peers
from companion.avoidance.certified.visibility_graph import Discs, Rectangles, rectangles
from companion.config import CompanionConfig
from companion.config.obstacles import Post
from companion.values.horizon import Array
from companion.ways.balls import Balls

_RESTED_US, _AT_REST_M = 2_000_000, 0.5
"""A vehicle rests if its newest plan ends where it was this time (µs) ago, within this distance (m).

Vehicles that jostle for room rest for a shorter time, and the turn of the goal resolves that.
"""
BESIDE_M = 0.05
"""Distance (m) of a way from what plans must keep clear of."""
_AROUND_M, _MOST_BOXES = 20.0, 8
"""How far (m) beside the ends of a way boxes are looked at, and how many of them at most."""


class WayObstacles:
    """Obstacles of one vehicle's ways."""

    def __init__(self, config: CompanionConfig, fixed: FixedSurfaces) -> None:
        self._config = config
        self.fixed = fixed
        self._departed = departed = DepartedVehicles(config)
        self.between = departed.between
        """Least distance (m) between two plans."""
        self.from_last = departed.from_last
        """See ``DepartedVehicles.from_last``."""

    def resting(
        self, epoch: int, here: Array, there: Array, peers: Peers, goals: Sequence[Array] = ()
    ) -> list[Discs]:
        """Return the discs that a way must avoid from ``epoch`` (µs) on; then those that stay for ever alone.

        They are seen from above: where posts, spheres, boxes, landed vehicles, and vehicles whose newest plan
        rests keep a vehicle away whose height is between those of ``here`` and ``there`` (3,), m, where the
        way begins and ends. ``goals`` (3,), m, of others count as if these rested there.
        """
        low, high = min(here[2], there[2]), max(here[2], there[2])
        fixed = []
        for one in self.fixed.round:
            above = 0.0 if isinstance(one, Post) else max(one.at[2] - high, low - one.at[2], 0.0)
            fixed.append((one.at[:2], self.fixed.least + one.radius, above))
        landed = [
            (tuple(last.controls[-1, 2, :2]), self.from_last(last), 0.0) for last in peers.left.values()
        ]
        ends = [
            (end, self._config.planar or system in peers.columns)
            for system, end in _ends_at_rest(epoch, peers).items()
        ]
        ends += [(goal, self._config.planar) for goal in goals]
        vehicles = []
        for end, level in ends:
            above = 0.0 if level else max(end[2] - high, low - end[2], 0.0) / self._config.field.downwash
            vehicles.append((tuple(end[:2]), self.between, above))
        rectangles = self._rectangles(here, there)
        return [
            _discs(found)._replace(rectangles=rectangles)
            for found in (fixed + landed + vehicles, fixed + landed)
        ]

    def at_rest(self, epoch: int, peers: Peers) -> Balls:
        """Return where others rest that a way must pass from ``epoch`` (µs) on, beside fixed obstacles.

        These are landed vehicles, and those whose newest plan rests. Of landed vehicles, of columns and in a
        plane heights do not count. Plans keep as much from these as from fixed obstacles.
        """
        places, kept, flat = [], [], []
        for last in peers.left.values():
            places.append(last.controls[-1, 2])
            kept.append(self.from_last(last))
            flat.append(0.0)
        for system, end in _ends_at_rest(epoch, peers).items():
            level = self._config.planar or system in peers.columns
            places.append(end)
            kept.append(self.between)
            flat.append(0.0 if level else 1.0 / self._config.field.downwash)
        radii = np.array(kept) - self.fixed.least
        return Balls(np.array(places).reshape(-1, 3), radii, np.array(flat))

    def occupied(self, epoch: int, goal: Array, peers: Peers) -> bool:
        """Return whether a vehicle rests on ``goal`` (3,), m, from ``epoch`` (µs) on, near a landed one.

        It is nearer to ``goal`` than plans keep. The landed vehicle may cover the goal of that one.
        """
        left = peers.left
        ends = _ends_at_rest(epoch, peers).values() if left else ()
        return any(self.apart(end - goal) < self.between and self._departed.near(end, left) for end in ends)

    def apart(self, difference: Array) -> float:
        """Return the distance (m) of two vehicles with a ``difference`` (3,), m, of places."""
        x, y, z = difference.tolist()
        return hypot(x, y, 0.0 if self._config.planar else z / self._config.field.downwash)

    def _rectangles(self, here: Array, there: Array) -> Rectangles:
        """Return where boxes keep a vehicle away on a way from ``here`` to ``there`` (3,), m.

        These are the ``_MOST_BOXES`` nearest to ``here`` of those about the way: the search takes time with
        the square of their number, and a way around those is good for the next metres.
        """
        low, high = np.minimum(here, there), np.maximum(here, there)
        rows = self.fixed.boxes.near(low[:2] - _AROUND_M, high[:2] + _AROUND_M)
        boxes = self.fixed.boxes.boxes.chosen(rows)
        above = np.maximum(boxes.centres[:, 2] - high[2], low[2] - boxes.centres[:, 2]) - boxes.halves[:, 2]
        above = np.maximum(above, 0.0)
        keep = np.flatnonzero(above < self.fixed.least)
        radii = np.sqrt(self.fixed.least**2 - above[keep] ** 2) + BESIDE_M
        found = rectangles(boxes.chosen(keep), radii)
        # No way leads out of a rectangle; a vehicle above or below a box may leave: planes keep it off.
        beside = (found.distance(np.stack([here[:2], there[:2]])) > 0.0).all(axis=0)
        found = Rectangles(*(part[beside] for part in found))
        if len(found.radii) <= _MOST_BOXES:
            return found
        nearest = np.argsort(found.distance(here[None, :2])[0], kind="stable")[:_MOST_BOXES]
        return Rectangles(*(part[nearest] for part in found))


def _ends_at_rest(epoch: int, peers: Peers) -> dict[int, Array]:
    """Return where the newest plans of vehicles that rest at ``epoch`` (µs) end (3,), m, by system id.

    Landed vehicles are left out.
    """
    resting = peers.resting(epoch - _RESTED_US, _AT_REST_M)
    return {system: end for system, end in resting.items() if system not in peers.left}


def _discs(found: list[tuple[tuple[float, ...], float, float]]) -> Discs:
    """Return the discs of ``found``: centre, radius, and distance above or below, m."""
    found = [one for one in found if one[2] < one[1]]
    return Discs(
        np.array([centre for centre, _, _ in found]).reshape(-1, 2),
        np.array([sqrt(radius * radius - above * above) + BESIDE_M for _, radius, above in found]),
    )
