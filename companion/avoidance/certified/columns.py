"""Columns of air: plans whose heights do not count, because an autopilot takes the vehicle off or lands it.

During take-off and landing the autopilot alone decides the vehicle's height. So its plan is a column: it
rests at a place, at all heights. An agreement on a column has upright planes, which both vehicles get by
looking at the other plan at the heights of the own one: then heights cancel, and all normals are horizontal,
exactly.
"""

from __future__ import annotations

from companion.avoidance.certified.separating_planes import agreed_planes, apart
from companion.values.horizon import Array

_ROUNDING_M = 1e-6
"""Distance (m) by which two plans may be nearer to each other than they must be, for rounding."""


class Distances:
    """Distances between plans, and the tests of two plans that depend on them.

    ``between``: least distance (m) between two plans in space; each column of the two adds ``further`` (m).
    ``planar``: heights never count. ``downwash``: height over width of the ellipsoid in which distances in
    space are measured. ``shift``: by how much planes move with both plans, see ``separating_planes``.
    """

    def __init__(
        self,
        between: float,
        further: float,
        *,
        planar: bool = False,
        downwash: float = 1.0,
        shift: float = 0.0,
    ) -> None:
        self._between, self._further, self._planar = between, further, planar
        self._downwash, self._shift = downwash, shift

    def least(self, columns: int) -> float:
        """Return the least distance (m) between two plans of which ``columns`` are columns."""
        return self._between + columns * self._further

    def agreed(self, own: Array, other: Array, columns: int) -> Array:
        """Return the rows of ``agreed_planes`` of the plans ``own`` and ``other``.

        Both are control points (k, 3, 3), m, on the same knots. ``columns``: number of columns among them.
        """
        return agreed_planes(
            own,
            levelled(other, own) if columns else other,
            self.least(columns),
            upright=self._planar or columns > 0,
            downwash=self._downwash,
            shift=self._shift,
        )

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
