"""Builders of messages in Foxglove's schemas (``foxglove_schemas``).

Lengths are in m. A quaternion rotates from the child frame to the parent frame; vehicle frames are FLU.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from outrider.palette import RGB

Json = dict[str, Any]
Point = Sequence[float]

_SHAPES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")


class Color(NamedTuple):
    """Red, green, blue and opacity, each 0…1."""

    r: float
    g: float
    b: float
    a: float = 1.0

    @classmethod
    def of(cls, colour: RGB) -> Color:
        """Return the opaque colour with the given sRGB values, each 0…255."""
        red, green, blue = (round(part / 255.0, 3) for part in colour)
        return cls(red, green, blue)

    def faint(self, opacity: float) -> Color:
        """Return the same colour with another opacity."""
        return self._replace(a=opacity)


def stamp(time_us: int) -> Json:
    """Convert Unix µs to seconds and nanoseconds."""
    return {"sec": time_us // 1_000_000, "nsec": time_us % 1_000_000 * 1000}


def point(at: Point) -> Json:
    """Return a position (m), rounded to 0.1 mm."""
    x, y, z = (round(float(part), 4) for part in at)
    return {"x": x, "y": y, "z": z}


def turn(quaternion: Sequence[float]) -> Json:
    """Return the quaternion message of (w, x, y, z), rounded to six decimals."""
    w, x, y, z = (round(float(part), 6) for part in quaternion)
    return {"x": x, "y": y, "z": z, "w": w}


def pose(at: Point, quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> Json:
    """Return the pose at a position, with the rotation (w, x, y, z)."""
    return {"position": point(at), "orientation": turn(quaternion)}


def transform(time_us: int, parent: str, child: str, at: Point, quaternion: Sequence[float]) -> Json:
    """Return the position and the attitude of the frame ``child`` in its ``parent``."""
    return {
        "timestamp": stamp(time_us),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": point(at),
        "rotation": turn(quaternion),
    }


def entity(
    time_us: int, frame: str, name: str, shapes: Mapping[str, list[Json]], *, locked: bool = False
) -> Json:
    """Return a scene entity, which is shown until another with the same ``name`` replaces it.

    Unused arrays of shapes are present and empty, because Foxglove's readers require them. ``locked``: the
    entity moves with its frame.
    """
    empty: dict[str, list[Json]] = {shape: [] for shape in _SHAPES}
    return {
        "timestamp": stamp(time_us),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": locked,
        "metadata": [],
        **empty,
        **shapes,
    }


def update(*entities: Json) -> Json:
    """Return a scene update that adds or replaces ``entities``."""
    return {"deletions": [], "entities": list(entities)}


def arrow(length: float, width: float, color: Color) -> Json:
    """Return an arrow from the frame's origin along x.

    The head is a third of its ``length``; ``width`` is the diameter of the shaft.
    """
    return {
        "pose": pose((0.0, 0.0, 0.0)),
        "shaft_length": length * 2 / 3,
        "shaft_diameter": width,
        "head_length": length / 3,
        "head_diameter": 2.5 * width,
        "color": color._asdict(),
    }


def sphere(at: Point, diameter: float, color: Color) -> Json:
    """Return a sphere with its centre at ``at``."""
    return {"pose": pose(at), "size": point((diameter,) * 3), "color": color._asdict()}


def cube(at: Point, size: Point, color: Color, quaternion: Sequence[float]) -> Json:
    """Return a box with its centre at ``at`` and its edges along the axes of the rotation (w, x, y, z)."""
    return {"pose": pose(at, quaternion), "size": point(size), "color": color._asdict()}


def cylinder(
    at: Point,
    diameter: float,
    height: float,
    color: Color,
    quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
) -> Json:
    """Return a cylinder along the z of the rotation (w, x, y, z), with its centre at ``at``."""
    return {
        "pose": pose(at, quaternion),
        "size": point((diameter, diameter, height)),
        "bottom_scale": 1.0,
        "top_scale": 1.0,
        "color": color._asdict(),
    }


def line(points: Sequence[Point], pixels: float, color: Color) -> Json:
    """Return a line through ``points``, ``pixels`` wide."""
    return {
        "type": 0,
        "pose": pose((0.0, 0.0, 0.0)),
        "thickness": pixels,
        "scale_invariant": True,
        "points": [point(at) for at in points],
        "color": color._asdict(),
        "colors": [],
        "indices": [],
    }


def label(at: Point, text: str, size: float, color: Color) -> Json:
    """Return a text that always faces the viewer; ``size`` is the height of the font, m."""
    return {
        "pose": pose(at),
        "billboard": True,
        "font_size": size,
        "scale_invariant": False,
        "color": color._asdict(),
        "text": text,
    }
