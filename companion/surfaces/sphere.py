"""Sphere around a point above the target, or its part above a height."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from companion.surfaces.circle import outward, ring
from companion.values.horizon import Array
from companion.values.settings import Settings

_MIN_DISTANCE_M = 1e-9


class Sphere(Settings):
    """All points at ``radius`` from the centre and not below ``lowest``."""

    kind: Literal["sphere"]
    radius: float = Field(4.0, gt=0.0, le=100.0, description="m")
    height: float = Field(0.0, ge=-50.0, le=100.0, description="of the centre, m above the target")
    lowest: float = Field(3.0, ge=-150.0, le=200.0, description="m above the target: no lower")

    @model_validator(mode="after")
    def _check_heights(self) -> Sphere:
        if self.lowest >= self.height + self.radius:
            raise ValueError(f"lowest must lie below the sphere's top, {self.height + self.radius:g}")
        return self

    def nearest(self, offset: Array) -> Array:
        """Return the points in the direction of ``offset`` from the centre.

        A point below ``lowest`` is replaced by the nearest point of the circle at that height. For an offset
        at the centre itself it is the top.
        """
        away = offset - (0.0, 0.0, self.height)
        distance = np.linalg.norm(away, axis=-1, keepdims=True)
        # From the centre all points are equally near; straight up is free of other vehicles.
        away = np.where(
            distance < _MIN_DISTANCE_M, (0.0, 0.0, 1.0), away / np.maximum(distance, _MIN_DISTANCE_M)
        )
        result: Array = self.radius * away
        result[..., 2] += self.height
        low = result[..., 2] < self.lowest
        if low.any():
            result[..., 0], result[..., 1] = (
                np.where(low, edge, inner)
                for edge, inner in zip(
                    outward(offset, self._lowest_radius), (result[..., 0], result[..., 1]), strict=True
                )
            )
            result[..., 2] = np.maximum(result[..., 2], self.lowest)
        return result

    def outline(self) -> Array:
        """Return the widest circle."""
        low = max(self.lowest, self.height)
        return ring(float(np.sqrt(self.radius**2 - (low - self.height) ** 2)), low)

    @property
    def _lowest_radius(self) -> float:
        """Radius (m) of the circle at ``lowest``."""
        return float(np.sqrt(max(0.0, self.radius**2 - (self.lowest - self.height) ** 2)))
