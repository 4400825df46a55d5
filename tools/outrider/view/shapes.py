"""Meshes of vehicles, obstacles and marks: vertices (V, 3), m, and faces (F, 3)."""

from __future__ import annotations

from math import cos, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.scene.airframe import Airframe

Array = NDArray[np.float64]


class Mesh(NamedTuple):
    """Vertices (V, 3) and vertex indices (F, 3) of triangles, counter-clockwise seen from outside."""

    vertices: Array
    faces: NDArray[np.int64]


def joined(*meshes: Mesh) -> Mesh:
    """Join meshes into one."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))


def prism(
    corners: int, radius: float, height: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Mesh:
    """Return an upright prism with its centre at ``at``."""
    turn = 2.0 * pi * np.arange(corners) / corners
    circle = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros(corners)], axis=1)
    up = np.array([0.0, 0.0, 0.5 * height])
    vertices = np.vstack([circle - up, circle + up, -up, up]) + at
    here, following = np.arange(corners), (np.arange(corners) + 1) % corners
    low, high = np.full(corners, 2 * corners), np.full(corners, 2 * corners + 1)
    faces = np.vstack(
        [
            np.stack([here, following, following + corners], axis=1),
            np.stack([here, following + corners, here + corners], axis=1),
            np.stack([following, here, low], axis=1),
            np.stack([here + corners, following + corners, high], axis=1),
        ]
    )
    return Mesh(vertices, faces)


def bar(begin: Array, end: Array, width: float) -> Mesh:
    """Return a horizontal beam between two positions."""
    along = (end - begin) / np.linalg.norm(end - begin)
    side = 0.5 * width * np.cross((0.0, 0.0, 1.0), along)
    up = np.array([0.0, 0.0, 0.5 * width])
    corners = [
        place + a * side + b * up for place in (begin, end) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    quads = ((0, 1, 2, 3), (7, 6, 5, 4), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
    faces = [face for a, b, c, d in quads for face in ((a, c, b), (a, d, c))]
    return Mesh(np.array(corners), np.array(faces))


def cone(length: float, radius: float, at: float) -> Mesh:
    """Return a cone along x with its base at x = ``at``."""
    count = 16
    turn = 2.0 * pi * np.arange(count) / count
    base = np.stack([np.full(count, at), radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    vertices = np.vstack([base, [[at + length, 0.0, 0.0]], [[at, 0.0, 0.0]]])
    here, following = np.arange(count), (np.arange(count) + 1) % count
    faces = np.vstack(
        [
            np.stack([here, following, np.full(count, count)], axis=1),
            np.stack([following, here, np.full(count, count + 1)], axis=1),
        ]
    )
    return Mesh(vertices, faces)


def rotors(airframe: Airframe) -> Mesh:
    """Return the discs of the rotors of an airframe whose span is 1 m; z is up."""
    return joined(*(prism(20, airframe.disc, 0.012, (x, y, 0.05)) for x, y in airframe.hubs))


def blades(airframe: Airframe) -> Mesh:
    """Return the two blades of one rotor along x, of an airframe whose span is 1 m."""
    reach = np.array([0.95 * airframe.disc, 0.0, 0.0])
    return joined(bar(-reach, reach, 0.028), prism(8, 0.03, 0.05))


def frame(airframe: Airframe) -> Mesh:
    """Return the body, and the arms with the motors, of an airframe whose span is 1 m."""
    ends = [np.array([x, y, 0.0]) for x, y in airframe.hubs]
    arms = (bar(np.zeros(3), end, 0.04) for end in ends)
    motors = (prism(10, 0.045, 0.07, (x, y, 0.015)) for x, y in airframe.hubs)
    return joined(prism(12, 0.11, 0.1), *arms, *motors)


def nose() -> Mesh:
    """Return a cone along x at the front of a body of 1 m span."""
    return cone(0.2, 0.06, 0.1)


def annulus(radius: float, width: float) -> Mesh:
    """Return a flat ring; both sides must be drawn."""
    count = 64
    turn = 2.0 * pi * np.arange(count) / count
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(count)], axis=1)
    vertices = np.vstack([(radius - width) * circle, radius * circle])
    here, following = np.arange(count), (np.arange(count) + 1) % count
    faces = np.vstack(
        [
            np.stack([here, here + count, following + count], axis=1),
            np.stack([here, following + count, following], axis=1),
        ]
    )
    return Mesh(vertices, faces)


def ball(radius: float) -> Mesh:
    """Return a sphere divided by latitude and longitude."""
    rows, columns = 12, 24
    polar = pi * np.arange(rows + 1) / rows
    turn = 2.0 * pi * np.arange(columns) / columns
    vertices = radius * np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.sin(polar), np.sin(turn)),
            np.outer(np.cos(polar), np.ones(columns)),
        ],
        axis=2,
    ).reshape(-1, 3)
    faces = []
    for row in range(rows):
        for column in range(columns):
            following = (column + 1) % columns
            a, b = row * columns + column, row * columns + following
            faces += [(a, a + columns, b + columns), (a, b + columns, b)]
    return Mesh(vertices, np.array(faces))


def box(size: tuple[float, float, float]) -> Mesh:
    """Return a box whose faces share no vertices, so that their light is even, with lengths ``size`` (m)."""
    quads = np.array(((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)))
    corners = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * size
    faces = np.add.outer(4 * np.arange(len(quads)), ((0, 1, 2), (0, 2, 3))).reshape(-1, 3)
    return Mesh(corners[quads.ravel()], faces)


def around_box(size: tuple[float, float, float], distance: float, steps: int) -> Mesh:
    """Return the surface at ``distance`` (m) from a box with lengths ``size`` (m); its edges are round.

    It is a sphere whose eight parts are moved apart; ``steps``: number of facets of a quarter of a circle.
    """
    rows, columns = 2 * (steps + 1), 4 * (steps + 1)
    # Each edge between two parts appears twice, once at either side of the gap.
    quarter = 0.5 * pi * np.arange(steps + 1) / steps
    polar = np.concatenate([quarter, 0.5 * pi + quarter])
    turn = np.concatenate([0.5 * pi * k + quarter for k in range(4)])
    side = np.repeat([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)], steps + 1, axis=0)
    vertices = np.empty((rows, columns, 3))
    vertices[..., 0] = distance * np.outer(np.sin(polar), np.cos(turn)) + 0.5 * size[0] * side[:, 0]
    vertices[..., 1] = distance * np.outer(np.sin(polar), np.sin(turn)) + 0.5 * size[1] * side[:, 1]
    vertices[..., 2] = distance * np.cos(polar)[:, None]
    vertices[: steps + 1, :, 2] += 0.5 * size[2]
    vertices[steps + 1 :, :, 2] -= 0.5 * size[2]
    here, following = np.arange(columns), (np.arange(columns) + 1) % columns
    top = np.arange(rows - 1)[:, None] * columns
    a, b = (top + here).ravel(), (top + following).ravel()
    sides = [np.stack([a, a + columns, b + columns], axis=1), np.stack([a, b + columns, b], axis=1)]
    # The flat faces above and below: their corners are the poles of the parts.
    corners = (steps + 1) * np.arange(4)
    below = (rows - 1) * columns + corners
    flat = [corners[[0, 1, 2]], corners[[0, 2, 3]], below[[0, 2, 1]], below[[0, 3, 2]]]
    return Mesh(vertices.reshape(-1, 3), np.vstack([*sides, *flat]))


def placed(mesh: Mesh, at: tuple[float, float, float], yaw: float) -> Mesh:
    """Return a mesh turned by ``yaw`` (rad) about z, then moved to ``at`` (m)."""
    x, y, z = mesh.vertices.T
    turned = np.stack([cos(yaw) * x - sin(yaw) * y, sin(yaw) * x + cos(yaw) * y, z], axis=1)
    return mesh._replace(vertices=turned + at)


def tile() -> Mesh:
    """Return a disc of 1 m diameter whose normal is z; both sides must be drawn."""
    count = 32
    turn = 2.0 * pi * np.arange(count) / count
    vertices = np.vstack([np.zeros(3), 0.5 * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)])
    here = np.arange(count)
    faces = np.stack([np.zeros(count, dtype=np.int64), here + 1, (here + 1) % count + 1], axis=1)
    return Mesh(vertices, faces)


def ground_lines(reach: float) -> tuple[float, float]:
    """Return the distances (m) between thin and between thick lines; a thick one is within ``reach`` (m)."""
    cell = float(10.0 ** np.floor(np.log10(reach / 3.0)))
    return cell, cell * (5.0 if reach >= 7.0 * cell else 2.0)
