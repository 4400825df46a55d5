"""Vertical cylinder around the target."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from companion.surfaces.circle import outward, ring
from companion.values.horizon import Array
from companion.values.settings import Settings


class Cylinder(Settings):
    """All points at ``radius`` from the vertical through the target, between two heights."""

    kind: Literal["cylinder"]
    radius: float = Field(4.0, ge=0.0, le=100.0, description="m")
    low: float = Field(4.0, ge=-50.0, le=100.0, description="m above the target")
    high: float = Field(8.0, ge=-50.0, le=100.0, description="m above the target")

    @model_validator(mode="after")
    def _check_heights(self) -> Cylinder:
        if self.low >= self.high:
            raise ValueError("low must lie below high")
        return self

    def nearest(self, offset: Array) -> Array:
        """Return the points horizontally outward at the same height, clipped to the cylinder's heights."""
        result = np.empty(offset.shape)
        result[..., 0], result[..., 1] = outward(offset, self.radius)
        result[..., 2] = np.clip(offset[..., 2], self.low, self.high)
        return result

    def outline(self) -> Array:
        """Return the circle halfway up."""
        return ring(self.radius, 0.5 * (self.low + self.high))
