"""The ray on which a detection is expected: the axes of its covariance, as a part of the fusion filter.

Errors of yaw move the place in proportion to the true distance, and errors of pixels and height grow with it.
With the measured distance the filter would learn the yaw from its noise, and would trust too short distances
more than too long ones: a bias of 2σ² of the relative error. The distance to the estimated place is used
instead, and the camera's covariance R is scaled by the square of the ratio, within limits.

The direction to that place is used, too: R is long along the ray and thin across it. With the measured ray as
axis, an error n across the ray looks like one along it of −n²/r (r: distance), which R trusts as an error
across: the place comes nearer to the camera by 2σ_l²/r, 0.11 m where σ_l along the ray is 0.65 m at 7.8 m,
however small the error across is. The axis is therefore the ray on which the detection is expected.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from companion.values.compiled import part
from companion.values.horizon import Array

_KNOWN = 25.0
"""m²: with a smaller trace of the place's covariance, the distance to the estimated place is used."""
_LEAST_SCALE = 0.25
"""Least factor of R; its inverse is the largest."""
_LEAST_LEVEL = 0.1
"""Cosine of the elevation below which the measured axes are used: yaw moves nothing straight below."""


@part
def _variance(P: Array, base: int, along: Array, yaw: float, elevation: float) -> float:
    """Return the variance (m²), by ``P``, of an expected detection ``along`` a direction (3,).

    ``base``: place of the errors of its vehicle; ``yaw`` and ``elevation``: m per rad, along the direction.
    """
    total = 0.0
    for i in range(8):
        j = i if i < 3 else base + i - 3
        weight = along[i % 3] if i < 6 else (yaw if i == 6 else elevation)
        for k in range(8):
            m = k if k < 3 else base + k - 3
            total += weight * P[j, m] * (along[k % 3] if k < 6 else (yaw if k == 6 else elevation))
    return total


@part
def _turn_axes(
    x: Array, P: Array, base: int, distance: float, row: Array, R: Array, sideways: Array, up: Array
) -> None:
    """Write the covariance R (3, 3) of the camera, and the directions of yaw and elevation, (3,).

    They are those of the detection ``row`` (FIELDS,), turned from the measured ray to the one on which it is
    expected: from the camera to the estimated place, by the estimated errors of its vehicle, the states ``x``
    from ``base`` on. ``distance`` (m): of the estimated place. By the error of this direction, by ``P``, an
    error along the ray is one across the axis: R is so much wider.
    """
    ahead, measured = np.empty(3), np.empty(3)
    for a in range(3):
        measured[a] = row[a] - row[18 + a]
        ahead[a] = x[a] + x[base + a] - row[18 + a]
        ahead[a] += distance * (row[12 + a] * x[base + 3] + row[15 + a] * x[base + 4])
    length = sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1] + ahead[2] * ahead[2])
    level = sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1])
    flat = sqrt(sideways[0] * sideways[0] + sideways[1] * sideways[1])
    far = sqrt(measured[0] * measured[0] + measured[1] * measured[1] + measured[2] * measured[2])
    if not (level > _LEAST_LEVEL * length and flat > _LEAST_LEVEL and far > 0.0):
        return
    along = high = wide = 0.0
    for a in range(3):
        for b in range(3):
            along += measured[a] * R[a, b] * measured[b] / (far * far)
            high += up[a] * R[a, b] * up[b]
            wide += sideways[a] * R[a, b] * sideways[b] / (flat * flat)
    sideways[0], sideways[1], sideways[2] = -ahead[1] / length, ahead[0] / length, 0.0
    up[0], up[1] = -ahead[2] * ahead[0] / (level * length), -ahead[2] * ahead[1] / (level * length)
    up[2] = level / length
    for a in range(3):
        measured[a] = sideways[a] * length / level
    share = along / (length * length)
    wide += share * _variance(P, base, measured, distance * level / length, 0.0)
    high += share * _variance(P, base, up, 0.0, distance)
    for a in range(3):
        for b in range(3):
            R[a, b] = (along - wide) * ahead[a] * ahead[b] / (length * length) + (high - wide) * up[a] * up[b]
        R[a, a] += wide


@part
def expect(x: Array, P: Array, base: int, row: Array, R: Array, yaw: Array, elevation: Array) -> None:
    """Write the covariance ``R`` (3, 3) of the camera, and what yaw and elevation add to the place.

    They are those of the detection ``row`` (FIELDS,) at the estimated place if that is known well enough,
    else at the measured one. ``yaw``, ``elevation`` (3,): m per rad. ``x`` (n,), ``P`` (n, n): the state;
    the errors of the vehicle begin at ``base``.
    """
    for a in range(3):
        for b in range(3):
            R[a, b] = row[3 + 3 * a + b]
        yaw[a], elevation[a] = row[12 + a], row[15 + a]
    distance = row[21]
    if P[0, 0] + P[1, 1] + P[2, 2] < _KNOWN:
        square = 0.0
        for a in range(3):
            square += (x[a] - row[18 + a]) ** 2
        distance = sqrt(square)
        _turn_axes(x, P, base, distance, row, R, yaw, elevation)
    scale = min(max((distance / row[21]) ** 2, _LEAST_SCALE), 1.0 / _LEAST_SCALE)
    for a in range(3):
        for b in range(3):
            R[a, b] *= scale
        yaw[a] *= distance
        elevation[a] *= distance
