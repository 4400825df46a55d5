"""Columns of air: plans whose heights do not count, because an autopilot takes the vehicle off or lands it.

During take-off and landing the autopilot alone decides the vehicle's height. So its plan is a column: it
rests at a place, at all heights. An agreement on a column has upright planes, which both vehicles get by
looking at the other plan at the heights of the own one: then heights cancel, and all normals are horizontal,
exactly.
"""

from __future__ import annotations

import numpy as np

from companion.avoidance.certified.separating_planes import agreed_planes, apart, keeps
from companion.values.horizon import Array

_ROUNDING_M = 1e-6
"""Distance (m) by which two plans may be nearer to each other than they must be, for rounding."""


class Distances:
    """Distances between plans, and the tests of two plans that depend on them.

    ``between``: least distance (m) between two plans in space; each column of the two adds ``further`` (m).
    ``planar``: heights never count. ``steps``: number of knots of a plan. ``downwash``: height over width of
    the ellipsoid in which distances in space are measured.
    """

    def __init__(
        self, between: float, further: float, steps: int, *, planar: bool = False, downwash: float = 1.0
    ) -> None:
        self._between, self._further, self._planar = between, further, planar
        self._downwash = downwash
        self._rows = np.full((1, steps + 1), between)

    def least(self, columns: int) -> float:
        """Return the least distance (m) between two plans of which ``columns`` are columns."""
        return self._between + columns * self._further

    def agreed(self, own: Array, other: Array, columns: int) -> Array:
        """Return the rows of ``agreed_planes`` of the plans ``own`` and ``other``.

        Both are control points (k, 3, 3), m, on the same knots. ``columns``: number of columns among them.
        """
        seen = levelled(other, own) if columns else other
        return agreed_planes(own, seen, self.least(columns), upright=self._planar, downwash=self._downwash)

    def keeps(self, newest: Array, own: Array, other: Array, columns: int) -> bool:
        """Return whether ``newest`` keeps the own side of the planes of the plans ``own`` and ``other``.

        All are control points (steps + 1, 3, 3), m, on the same knots. ``columns``: number of columns among
        ``own`` and ``other``.
        """
        seen = levelled(other, own) if columns else other
        rows = self._rows + columns * self._further
        return keeps(newest, own, seen, rows, upright=self._planar, downwash=self._downwash)

    def apart(self, one: Array, other: Array, columns: int) -> bool:
        """Return whether two plans are the least distance apart at all times, horizontally near a column."""
        least = self.least(columns) - (_ROUNDING_M if columns else 0.0)
        upright = self._planar or columns > 0
        return apart(one, other, least, upright=upright, downwash=self._downwash)


def levelled(plan: Array, own: Array) -> Array:
    """Return control points (…, 3), m, at the places of ``plan`` and at the heights of ``own``."""
    found: Array = plan.copy()
    found[..., 2] = own[..., 2]
    return found
