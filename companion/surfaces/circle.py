"""The paper's surface: a horizontal circle around the target (Sec. III-B)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from companion.values.horizon import Array
from companion.values.settings import Settings

TURNS = np.linspace(0.0, 2.0 * np.pi, 73)
"""Angles (rad) of the points of an outline."""


class Circle(Settings):
    """Horizontal circle around the target."""

    kind: Literal["circle"] = "circle"
    radius: float = Field(4.0, ge=0.0, le=100.0, description="m")
    height: float = Field(5.0, ge=-50.0, le=100.0, description="m above the target")

    def nearest(self, offset: Array) -> Array:
        """Return [d cos ψ, d sin ψ, h] with ψ the bearing of the vehicle *from the target*.

        d is ``radius`` and h is ``height``. ψ is 0 (east) if the vehicle is straight above the target.
        """
        result = np.empty(offset.shape)
        result[..., 0], result[..., 1] = outward(offset, self.radius)
        result[..., 2] = self.height
        return result

    def outline(self) -> Array:
        """Return the circle itself."""
        return ring(self.radius, self.height)


def outward(offset: Array, radius: float) -> tuple[Array, Array]:
    """Return east and north (…,), m, at ``radius`` (m) in the direction of offsets (…, 3)."""
    psi = np.arctan2(offset[..., 1], offset[..., 0])
    return radius * np.cos(psi), radius * np.sin(psi)


def ring(radius: float, height: float) -> Array:
    """Return points (n, 3) of a horizontal circle, m."""
    return np.column_stack([radius * np.cos(TURNS), radius * np.sin(TURNS), np.full(len(TURNS), height)])
