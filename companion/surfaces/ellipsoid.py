"""Ellipsoid around a point above the target."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from companion.surfaces.circle import TURNS
from companion.values.horizon import Array
from companion.values.settings import Settings

_Axis = Annotated[float, Field(ge=0.1, le=100.0)]
_HALVINGS = 80
"""Number of bisections; the bracket is then narrower than a float can resolve."""


class Ellipsoid(Settings):
    """Ellipsoid with semi-axes east, north, up about a centre ``height`` above the target."""

    kind: Literal["ellipsoid"]
    semi_axes: tuple[_Axis, _Axis, _Axis] = Field((6.0, 4.0, 2.0), description="m, east, north, up")
    height: float = Field(6.0, ge=-50.0, le=200.0, description="of the centre, m above the target")

    def nearest(self, offset: Array) -> Array:
        """Return the nearest points, the feet of the perpendiculars, from inside or outside.

        With y the point from the centre and e the semi-axes, the foot is x_i = e_i² y_i/(t + e_i²), where t
        is the largest root of Σ (e_i y_i/(t + e_i²))² = 1. The root lies above −min e² and the sum decreases
        there, so that bisection finds it (D. Eberly, Distance from a Point to an Ellipse, an Ellipsoid, or a
        Hyperellipsoid).
        """
        e = np.asarray(self.semi_axes)
        y = offset - (0.0, 0.0, self.height)
        # For a point inside, in a plane of symmetry, the foot may leave the plane: a small offset selects the
        # side.
        y = np.where(np.abs(y) < 1e-9 * e, 1e-9 * e, y)
        low = np.max(e * np.abs(y) - e**2, axis=-1)
        high = np.linalg.norm(e * y, axis=-1) - float(np.min(e)) ** 2
        for _ in range(_HALVINGS):
            t = 0.5 * (low + high)
            outside = np.sum((e * y / (t[..., None] + e**2)) ** 2, axis=-1) > 1.0
            low, high = np.where(outside, t, low), np.where(outside, high, t)
        t = 0.5 * (low + high)
        foot: Array = e**2 * y / (t[..., None] + e**2)
        foot[..., 2] += self.height
        return foot

    def outline(self) -> Array:
        """Return the widest horizontal section."""
        a, b, _ = self.semi_axes
        return np.column_stack([a * np.cos(TURNS), b * np.sin(TURNS), np.full(len(TURNS), self.height)])
