"""Moving planes between a vehicle and everything else.

They keep two new plans apart although each side knows only the other's old plan. For a neighbour and a
segment, r_i are the control points of the own committed plan minus the neighbour's (the same knots, so the
same index), x the point of their triangle nearest to the origin, c = x/‖x‖. Both sides compute the same plane
with opposite normals, because floating point is symmetric under a change of sign. The new plan's control
point i must satisfy

    c·q_i ≥ c·(own_i + other_i)/2 + min(d, c·r_i)/2,

and the neighbour's the same from the other side. So any two new plans are min(d, c·r_i) apart along c at
every control point, hence everywhere on the segment (a Bézier curve lies in the hull of its control points).
The committed plan itself satisfies it, with room max(c·r_i − d, 0)/2. Obstacles that share no plan get the
whole margin from the own side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.values.horizon import Array

_TINY = 1e-12


class Others(NamedTuple):
    """M plans to keep away from.

    ``controls`` (M, n, 3, 3), m: control points on the own plan's knots. ``distance`` (M, n), m: least
    distance on each segment. ``shares`` (M,): whether the other side keeps half of it itself.
    """

    controls: Array
    distance: Array
    shares: NDArray[np.bool_]


class Planes(NamedTuple):
    """Normals c (M, n, 3), and the least c·q for each control point (M, n, 3).

    ``least`` is what must hold; ``wanted`` is slightly more where the committed plan has it, so that rounding
    breaks nothing. ``room`` (M, n, 3): by how much the committed plan holds.
    """

    normals: Array
    least: Array
    wanted: Array
    room: Array


def planes(own: Array, others: Others, spare: float, *, upright: bool = False) -> Planes:
    """Return the planes about the committed control points ``own`` (n, 3, 3), m.

    ``spare`` (m) is wanted beyond the least distance. ``upright``: heights do not count.
    """
    relative = own - others.controls
    if upright:
        relative[..., 2] = 0.0
    normals = nearest(relative.reshape(-1, 3, 3)).reshape((*relative.shape[:2], 3))
    # (M, n, 3): one value for each control point.
    gap = np.einsum("mnk,mnik->mni", normals, relative)
    here = np.einsum("mnk,nik->mni", normals, own)
    part = np.where(others.shares, 0.5, 1.0)[:, None, None]
    distance = others.distance[:, :, None]
    room = part * np.maximum(gap - distance, 0.0)
    wanted = part * np.maximum(gap - distance - spare, 0.0)
    return Planes(normals, here - room, here - wanted, room)


def nearest(triangles: Array) -> Array:
    """Return unit vectors (k, 3) from the origin to the nearest point of each triangle (k, 3, 3).

    The interior of a flat triangle is of no use: of edges and interior, the one that holds the triangle
    further off counts. A triangle about the origin gets some unit vector: nothing separates it.
    """
    following = triangles[:, (1, 2, 0)]
    edges = following - triangles
    square = np.einsum("kei,kei->ke", edges, edges)
    share = -np.einsum("kei,kei->ke", triangles, edges) / np.maximum(square, _TINY)
    points = triangles + np.minimum(np.maximum(share, 0.0), 1.0)[..., None] * edges
    normal = _cross(edges[:, 0], edges[:, 1])
    # The normal of the triangle's plane, towards the triangle.
    normal *= np.where(np.einsum("ki,ki->k", normal, triangles[:, 0]) < 0.0, -1.0, 1.0)[:, None]
    candidates = _unit(np.concatenate([points, normal[:, None]], axis=1))
    margins = np.einsum("kci,kvi->kcv", candidates, triangles).min(axis=2)
    best = margins.argmax(axis=1)
    result: Array = candidates[np.arange(len(best)), best]
    result[~result.any(axis=1)] = (1.0, 0.0, 0.0)
    return result


def hull_distance(triangles: Array) -> Array:
    """Return the distance (k,), m, of each triangle (k, 3, 3) from the origin; 0 if it holds the origin."""
    normals = nearest(triangles)
    result: Array = np.maximum(np.einsum("ki,kvi->kv", normals, triangles).min(axis=1), 0.0)
    return result


def _cross(a: Array, b: Array) -> Array:
    """Return the cross products of rows (k, 3); ``np.cross`` takes several times as long for few rows."""
    result: Array = a[:, (1, 2, 0)] * b[:, (2, 0, 1)] - a[:, (2, 0, 1)] * b[:, (1, 2, 0)]
    return result


def _unit(vectors: Array) -> Array:
    """Return unit vectors (k, c, 3); near-zero vectors yield zero.

    A fixed direction instead would win now and then by a rounding error, on one side only.
    """
    norm = np.sqrt(np.einsum("kci,kci->kc", vectors, vectors))
    short = norm < _TINY
    result: Array = vectors / np.where(short, 1.0, norm)[..., None]
    result[short] = 0.0
    return result
