"""Planes in the middle between committed plans, along the normals of the companions' planes.

Companions keep to planes of agreements, which rest on older plans and may lie nearer to the vehicle ahead of
another one (``separating_planes``); pictures show the newest plans.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.separating_planes import nearest
from outrider.scene.snapshot import Array, Single

NEAR = 8.0
"""Largest distance (m) of two vehicles with a plane in the picture."""
MOST = 16
"""Largest number of planes in a picture; more would be unreadable."""


class Plane(NamedTuple):
    """Middles (n, 3), unit normals (n, 3) and gaps (n,) of the hulls, m; n ≤ MOST, tightest first."""

    middle: Array
    normal: Array
    gap: Array


def between(plan: Single, step_s: float) -> Plane:
    """Return the plane of each pair of ``plan`` (K, KNOTS, 6) at the segment where the pair is closest.

    ``step_s`` is the duration of a segment (s). Pairs that start NEAR or more apart have no plane. Of more
    than MOST planes, those with the smallest gaps are returned.
    """
    knots = plan.astype(np.float64)
    place, velocity = knots[..., :3], knots[..., 3:]
    # The control points of a segment with constant acceleration, (K, n, 3, 3).
    controls = np.stack(
        [place[:, :-1], place[:, :-1] + 0.5 * step_s * velocity[:, :-1], place[:, 1:]], axis=2
    )
    # A short plan repeats its last knot: in such a segment the vehicle stays there.
    still = np.isclose(place[:, :-1], place[:, 1:]).all(axis=2)
    controls[still] = place[:, :-1][still][:, None]
    one, other = np.triu_indices(len(plan), 1)
    close = np.linalg.norm(place[one, 0] - place[other, 0], axis=1) < NEAR
    one, other = one[close], other[close]
    if not len(one):
        return Plane(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    relative = controls[one] - controls[other]
    normals = nearest(relative.reshape(-1, 3, 3)).reshape(*relative.shape[:2], 3)
    gaps = np.einsum("pnk,pnik->pni", normals, relative).min(axis=2)
    worst = gaps.argmin(axis=1)
    row = np.arange(len(one))
    middle = 0.5 * (controls[one, worst] + controls[other, worst]).mean(axis=1)
    gap = gaps[row, worst]
    order = np.argsort(gap)[:MOST]
    return Plane(middle[order], normals[row, worst][order], gap[order])


def facing(normal: Array) -> Array:
    """Return the quaternions (n, 4), w x y z, that rotate the z axis to ``normal`` (n, 3)."""
    # Half-way between both: 1 + n·z and z × n.
    result = np.stack([1.0 + normal[:, 2], -normal[:, 1], normal[:, 0], 0.0 * normal[:, 0]], axis=1)
    length = np.linalg.norm(result, axis=1)
    result[length < 1e-9] = (0.0, 1.0, 0.0, 0.0)
    turned: Array = result / np.where(length < 1e-9, 1.0, length)[:, None]
    return turned
