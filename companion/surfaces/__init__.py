"""Destination surfaces around a target: takes offsets from the target, gives the surface's nearest points.

The paper allows any surface (Sec. IV-A: "our approach can attain any desired 3D destination surface"). A
surface is a set of offsets from the target, fleet-local ENU, m. The destination is its point nearest to the
vehicle, x̌ = x_P + nearest(x_R − x_P) with the positions x_P of the target and x_R of the vehicle; for the
paper's circle that is the paper's formula (Sec. III-B). The configuration sets kind and size, for all
vehicles or for each one.
"""

from __future__ import annotations

from typing import Annotated, Any, Protocol

from pydantic import Discriminator, Tag

from companion.surfaces.circle import Circle
from companion.surfaces.cylinder import Cylinder
from companion.surfaces.ellipsoid import Ellipsoid
from companion.surfaces.parametric import Parametric
from companion.surfaces.sphere import Sphere
from companion.values.horizon import Array

__all__ = ["Circle", "Cylinder", "Ellipsoid", "Parametric", "Sphere", "Surface", "SurfaceConfig"]


class Surface(Protocol):
    """Surface around a target on which vehicles have their destinations."""

    def nearest(self, offset: Array) -> Array:
        """Return the points (…, 3) of the surface nearest to offsets (…, 3) from the target, m."""
        ...

    def outline(self) -> Array:
        """Return points (n, 3) of a closed line on the surface, m, for drawing it from above."""
        ...


def _kind(value: Any) -> str:
    """Return the kind of a surface; without one it is the paper's circle."""
    kind = value.get("kind", "circle") if isinstance(value, dict) else getattr(value, "kind", "circle")
    return str(kind)


SurfaceConfig = Annotated[
    Annotated[Circle, Tag("circle")]
    | Annotated[Sphere, Tag("sphere")]
    | Annotated[Cylinder, Tag("cylinder")]
    | Annotated[Ellipsoid, Tag("ellipsoid")]
    | Annotated[Parametric, Tag("parametric")],
    Discriminator(_kind),
]
