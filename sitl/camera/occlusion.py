"""Bodies that hide what is behind them: balls, columns, boxes, and the ground. Site NED, metres."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float, float]
Array = NDArray[np.float64]


class Body(Protocol):
    """Opaque body."""

    def hides(self, eye: Point, point: Point) -> bool:
        """Return whether it crosses the straight line from ``eye`` to ``point``."""

    def moved(self, by: Point) -> Body:
        """Return it moved."""


class Ball(NamedTuple):
    """Ball around ``centre``."""

    centre: Point
    radius: float

    def hides(self, eye: Point, point: Point) -> bool:
        """Return whether the line from ``eye`` to ``point`` comes nearer to the centre than the radius."""
        x, y, z = (b - a for a, b in zip(eye, point, strict=True))
        p, q, r = (c - a for a, c in zip(eye, self.centre, strict=True))
        square = x * x + y * y + z * z
        share = (p * x + q * y + r * z) / square if square else 0.0
        share = max(0.0, min(1.0, share))
        return math.hypot(p - share * x, q - share * y, r - share * z) < self.radius

    def moved(self, by: Point) -> Ball:
        """Return the ball with its centre moved."""
        return Ball((self.centre[0] + by[0], self.centre[1] + by[1], self.centre[2] + by[2]), self.radius)


class Column(NamedTuple):
    """Vertical cylinder around ``axis`` (north, east), without a lower end.

    Its upper end is at ``top`` (down), also when it moves.
    """

    axis: tuple[float, float]
    radius: float
    top: float

    def hides(self, eye: Point, point: Point) -> bool:
        """Return whether the line from ``eye`` to ``point`` crosses the cylinder below its upper end."""
        x, y = point[0] - eye[0], point[1] - eye[1]
        p, q = self.axis[0] - eye[0], self.axis[1] - eye[1]
        square, along = x * x + y * y, p * x + q * y
        apart = p * p + q * q - self.radius**2
        if square == 0.0:
            if apart >= 0.0:
                return False
            first, last = 0.0, 1.0
        else:
            root = along * along - square * apart
            if root <= 0.0:
                return False
            half = math.sqrt(root)
            first, last = max(0.0, (along - half) / square), min(1.0, (along + half) / square)
        if first >= last:
            return False
        lowest = max(eye[2] + share * (point[2] - eye[2]) for share in (first, last))
        return lowest > self.top

    def moved(self, by: Point) -> Column:
        """Return the cylinder with its axis moved horizontally."""
        return self._replace(axis=(self.axis[0] + by[0], self.axis[1] + by[1]))


class Blocks:
    """M boxes with upright sides, around ``centres`` (M, 3), in the order of north.

    ``halves`` (M, 3): half of their lengths along their own axes, of which x and y are level; ``turns``
    (M, 2): cosine and sine of the heading of their x axes, from north to east.
    """

    def __init__(self, centres: Array, halves: Array, turns: Array) -> None:
        order = np.argsort(centres[:, 0], kind="stable")
        self.centres, self.halves, self.turns = centres[order], halves[order], turns[order]
        self._north = np.ascontiguousarray(self.centres[:, 0])
        self._reach = np.hypot(self.halves[:, 0], self.halves[:, 1])
        self._largest = self._reach.max(initial=0.0)

    def hides(self, eye: Point, point: Point) -> bool:
        """Return whether the line from ``eye`` to ``point`` crosses any of the boxes.

        A part of the line lies between each two opposite sides of a box, and in the box where the three parts
        overlap. A line along a side does not cross it.
        """
        near = self._beside(eye, point)
        halves = self.halves[near]
        begin = self._own(near, np.subtract(eye, self.centres[near]))
        step = self._own(near, np.broadcast_to(np.subtract(point, eye), begin.shape))
        with np.errstate(divide="ignore", invalid="ignore"):
            enters = (-np.copysign(halves, step) - begin) / step
            leaves = (np.copysign(halves, step) - begin) / step
        along, between = step == 0.0, np.abs(begin) < halves
        enters = np.where(along, np.where(between, -np.inf, np.inf), enters)
        leaves = np.where(along, np.inf, leaves)
        first, last = enters.max(axis=1), leaves.min(axis=1)
        return bool((np.maximum(first, 0.0) < np.minimum(last, 1.0)).any())

    def moved(self, by: Point) -> Blocks:
        """Return the boxes with their centres moved."""
        return Blocks(self.centres + by, self.halves, self.turns)

    def _beside(self, eye: Point, point: Point) -> NDArray[np.int64]:
        """Return the rows (n,) of the boxes that the bounds of the line, seen from above, may touch."""
        low, high = np.minimum(eye, point), np.maximum(eye, point)
        ends = (low[0] - self._largest, high[0] + self._largest)
        first, last = np.searchsorted(self._north, ends)
        places, reach = self.centres[first:last, :2], self._reach[first:last, None]
        near = (places + reach >= low[:2]) & (places - reach <= high[:2])
        return np.flatnonzero(near.all(axis=1)) + int(first)

    def _own(self, rows: NDArray[np.int64], offsets: Array) -> Array:
        """Return ``offsets`` (n, 3) in the axes of the boxes in ``rows`` (n,)."""
        (north, east, down), (cosine, sine) = offsets.T, self.turns[rows].T
        return np.stack([cosine * north + sine * east, cosine * east - sine * north, down], axis=1)


class Ground(NamedTuple):
    """Level ground at ``down`` (m)."""

    down: float

    def hides(self, eye: Point, point: Point) -> bool:
        """Return whether ``point`` is below the ground; an eye never is."""
        return point[2] > self.down

    def moved(self, by: Point) -> Ground:
        """Return the ground moved vertically."""
        return Ground(self.down + by[2])


def hidden(eye: Point, points: Iterable[Point], bodies: Iterable[Body]) -> bool:
    """Return whether any of ``bodies`` hides any of ``points`` from ``eye``."""
    seen = list(points)
    return any(body.hides(eye, point) for body in bodies for point in seen)
