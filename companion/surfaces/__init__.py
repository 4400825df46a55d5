"""Destination surfaces around a target (Sec. III-A: "our approach can attain any desired 3D destination
surface").

A surface is a set of offsets from the target, fleet-local ENU, m. The destination is its point nearest to the
vehicle, x̌ = x_P + nearest(x_R − x_P): of the paper's circle that is the paper's formula. Which kind it is and
how large stands in the configuration, for each vehicle if need be.
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
    """Where vehicles are to be around a target."""

    def nearest(self, offset: Array) -> Array:
        """The points (…, 3) of the surface that are nearest to offsets (…, 3) from the target, m."""
        ...

    def outline(self) -> Array:
        """Points (n, 3) of a closed line on it, m: what is drawn of it from above."""
        ...


def _kind(value: Any) -> str:
    """Where no kind is said it is the paper's circle."""
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
