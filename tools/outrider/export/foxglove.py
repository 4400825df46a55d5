"""Makes the values of Foxglove's well-known messages (``foxglove_schemas``).

Lengths are m; a quaternion turns a body's frame (x forward, y left, z up) into its parent's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

Json = dict[str, Any]
Point = Sequence[float]

_SHAPES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")


class Color(NamedTuple):
    """Red, green, blue and opacity, 0…1."""

    r: float
    g: float
    b: float
    a: float = 1.0

    def faint(self, opacity: float) -> Color:
        """The same, seen through."""
        return self._replace(a=opacity)


def stamp(time_us: int) -> Json:
    """Unix µs."""
    return {"sec": time_us // 1_000_000, "nsec": time_us % 1_000_000 * 1000}


def point(at: Point) -> Json:
    """A position, to a tenth of a millimetre."""
    x, y, z = (round(float(part), 4) for part in at)
    return {"x": x, "y": y, "z": z}


def turn(quaternion: Sequence[float]) -> Json:
    """From (w, x, y, z)."""
    w, x, y, z = (round(float(part), 6) for part in quaternion)
    return {"x": x, "y": y, "z": z, "w": w}


def pose(at: Point) -> Json:
    """At a place, not turned."""
    return {"position": point(at), "orientation": turn((1.0, 0.0, 0.0, 0.0))}


def transform(time_us: int, parent: str, child: str, at: Point, quaternion: Sequence[float]) -> Json:
    """Where the frame ``child`` is in its ``parent``."""
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
    """Something to be seen until another of its ``name`` comes; all arrays are there, as Foxglove's readers
    expect."""
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
    """A scene, or what is new in it."""
    return {"deletions": [], "entities": list(entities)}


def arrow(length: float, width: float, color: Color) -> Json:
    """From the frame's origin forward; a third of it is its head."""
    return {
        "pose": pose((0.0, 0.0, 0.0)),
        "shaft_length": length * 2 / 3,
        "shaft_diameter": width,
        "head_length": length / 3,
        "head_diameter": 2.5 * width,
        "color": color._asdict(),
    }


def sphere(at: Point, diameter: float, color: Color) -> Json:
    """A ball."""
    return {"pose": pose(at), "size": point((diameter,) * 3), "color": color._asdict()}


def cylinder(at: Point, diameter: float, height: float, color: Color) -> Json:
    """Upright, ``at`` its middle."""
    return {
        "pose": pose(at),
        "size": point((diameter, diameter, height)),
        "bottom_scale": 1.0,
        "top_scale": 1.0,
        "color": color._asdict(),
    }


def line(points: Sequence[Point], pixels: float, color: Color) -> Json:
    """A line through ``points``."""
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
    """A word that faces who looks; ``size`` in m."""
    return {
        "pose": pose(at),
        "billboard": True,
        "font_size": size,
        "scale_invariant": False,
        "color": color._asdict(),
        "text": text,
    }
