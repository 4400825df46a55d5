"""Random positions with distance from each other: of vehicles, of a jumping target, of obstacles.

Each vehicle and each obstacle is drawn clear of those before it (random sequential addition); without enough
room InputError is raised. Each position of the target has a given distance from the one before it. All values
are whole millimetres, so that a file holds exactly what was checked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import JsonValue

from outrider.errors import InputError
from outrider.sweep.scenes import Blocks, Scene

Array = NDArray[np.float64]

_BATCH, _ROUNDS = 32, 160
"""Number of candidates in a batch, and number of batches after which the search for a position fails."""


class Circles(NamedTuple):
    """Positions (n, 2) and radii (n,), m, that obstacles keep clear of; points have radius 0.

    If ``hollow``, only the circle line is kept clear; obstacles may be inside.
    """

    centres: Array
    radii: Array
    hollow: bool = False


def scatter(random: np.random.Generator, scene: Scene, count: int, half: float, what: str) -> Array:
    """Return positions (count, 3), m, in a square of ± ``half`` m.

    The horizontal distance of any two is at least ``scene.apart`` (m). Raises InputError if there is no room;
    ``what`` names the positions in its message.
    """
    placed = np.empty((count, 3))
    heights = _mm(random.uniform(*scene.height, size=count))
    for k in range(count):
        for _ in range(_ROUNDS):
            found = _mm(random.uniform(-half, half, size=(_BATCH, 2)))
            off = found[:, None] - placed[None, :k, :2]
            free = np.flatnonzero((np.hypot(off[..., 0], off[..., 1]) >= scene.apart).all(axis=1))
            if free.size:
                placed[k] = *found[free[0]], heights[k]
                break
        else:
            raise InputError(
                f"{what} {k + 1} of {count} finds no place {scene.apart:g} m from the others in a square of "
                f"{2 * half:.1f} m; allowed: less density, or less apart"
            )
    return placed


def walk(random: np.random.Generator, jumps: int, length: float, extent: float) -> Array:
    """Return positions (jumps + 1, 2) of the target, m, each ``length`` from the one before.

    All lie within ±``extent`` ≥ ``length``, so that at least a quarter of all directions leads to an allowed
    position.
    """
    places = [np.zeros(2)]
    while len(places) <= jumps:
        angle = random.uniform(0.0, 2.0 * math.pi)
        place = _mm(places[-1] + length * np.array([math.cos(angle), math.sin(angle)]))
        if np.abs(place).max() <= extent:
            places.append(place)
    return np.array(places)


def obstacles(
    random: np.random.Generator,
    scene: Scene,
    counts: tuple[int, int, int],
    extent: float,
    kept: Sequence[Circles],
    where: str,
) -> list[JsonValue]:
    """Return ``counts[0]`` spheres, then ``counts[1]`` posts and ``counts[2]`` boxes, as in a scenario file.

    Their centres are in a square of ± ``extent`` m. Horizontally, each surface is at least ``scene.clear``
    (m) from the circles in ``kept`` and ``scene.gap`` (m) from other obstacles, where the circle about a box
    counts. Raises InputError if there is no room.
    """
    placed = np.empty((0, 3))
    found: list[JsonValue] = []
    kinds = zip((scene.spheres, scene.posts, scene.boxes), counts, ("sphere", "post", "box"), strict=True)
    for kind, count, word in kinds:
        if kind is None:
            continue
        for k in range(count):
            edges: list[float] = []
            if isinstance(kind, Blocks):
                edges = _mm(random.uniform(*kind.size, size=2)).tolist()
                radius = 0.5 * math.hypot(*edges)
            else:
                radius = float(_mm(random.uniform(*kind.radius)))
            height = float(_mm(random.uniform(*kind.height)))
            place = _free(random, radius, extent, scene, kept, placed)
            if place is None:
                raise InputError(
                    f"{where}: {word} {k + 1} of {count} finds no place {scene.clear:g} m clear of starts, "
                    f"goals and circles and {scene.gap:g} m from other obstacles in a square of "
                    f"{2 * extent:.1f} m; allowed: fewer obstacles, less density, clear or gap"
                )
            placed = np.vstack([placed, [*place, radius]])
            x, y = place.tolist()
            if word == "sphere":
                found.append({"kind": "sphere", "at": [x, y, height], "radius": radius})
            elif word == "post":
                found.append({"kind": "post", "at": [x, y], "radius": radius, "height": height})
            else:
                yaw = float(_mm(random.uniform(0.0, 180.0)))
                size: list[JsonValue] = [*edges, height]
                found.append({"kind": "box", "at": [x, y, 0.5 * height], "size": size, "yaw_deg": yaw})
    return found


def _free(
    random: np.random.Generator,
    radius: float,
    extent: float,
    scene: Scene,
    kept: Sequence[Circles],
    placed: Array,
) -> Array | None:
    """Return a position (2,) for an obstacle, m; None if none was found."""
    for _ in range(_ROUNDS):
        found = _mm(random.uniform(-extent, extent, size=(_BATCH, 2)))
        ok = _apart(found, placed[:, :2]) - placed[:, 2] - radius >= scene.gap
        free = ok.all(axis=1)
        for circles in kept:
            space = _apart(found, circles.centres) - circles.radii
            if circles.hollow:
                space = np.abs(space)
            free &= (space - radius >= scene.clear).all(axis=1)
        index = np.flatnonzero(free)
        if index.size:
            place: Array = found[index[0]]
            return place
    return None


def _apart(points: Array, others: Array) -> Array:
    """Return the distances (n, k), m, of ``points`` (n, 2) from ``others`` (k, 2)."""
    off = points[:, None] - others[None]
    return np.asarray(np.hypot(off[..., 0], off[..., 1]))


def _mm(values: Array | float) -> Array:
    """Round to whole millimetres, without negative zeros."""
    return np.asarray(np.round(values, 3) + 0.0)
