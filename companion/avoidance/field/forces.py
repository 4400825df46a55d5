"""Repulsive potential field of the paper, eqs. (9) and (10), over the whole horizon.

F(d) = K · (π/2)/(d_safe − d_min) · (cot z + z − π/2),  z = (π/2)(d − d_min)/(d_safe − d_min)

Deviations from the paper: the force points *away* from the obstacle (the printed α points towards it). Below
d_min the formula turns negative, so it is clamped there, far above what the vehicle has. The sum is limited
to a_total, not its parts: otherwise an obstacle that pushes from behind would cancel one that is about to be
hit.

Closing speed. From d_safe = 3 m the bare field cannot stop two vehicles that meet at 5 m/s each: that takes
about 10 m/s² net. So the distance that enters F is what would be left after braking, d − ċ²/(2 a_rel) with ċ
the closing speed and a_rel the relative deceleration to count on. At rest this is the paper's field; at a
high closing speed its reach grows with the square of the speed, and d_min is approached no faster than the
vehicle can brake. With bounded jerk a vehicle brakes late: ``reaction`` seconds of closing are subtracted,
too. Where the distance grows the term is added, until the distance from d_min is doubled: a field that pushes
as hard on the way out as on the way in throws vehicles out of every encounter. ``braking=None`` is the
paper's field alone.
"""

from __future__ import annotations

from math import pi

import numpy as np

from companion.values.horizon import Array
from companion.values.obstacles import Obstacles

_CLOSES = 1.0
"""Closing speed (m/s) from which ``turn`` applies in full."""
_NEAR = 1e-6
"""Distance (m) below which no direction points away; the force then points along +x."""


def magnitude(distance: Array, d_min: Array, d_safe: Array, gain: float, clamp: float) -> Array:
    """Return F_hyp(d), m/s²; the shapes broadcast.

    It is 0 from d_safe on, continuous and decreasing, and ``clamp`` at and below d_min.
    """
    width = d_safe - d_min
    z = np.minimum(np.maximum((0.5 * pi) * (distance - d_min) / width, 1e-9), 0.5 * pi)
    force: Array = np.minimum((gain * 0.5 * pi) * (1.0 / np.tan(z) + z - 0.5 * pi) / width, clamp)
    return np.maximum(force, 0.0, out=force)


def repulsion(
    own: Array,
    obstacles: Obstacles,
    gain: float,
    clamp: float,
    braking: float | None,
    dt: float,
    reaction: float = 0.0,
    turn: float = 0.0,
) -> Array:
    """Return Σ_j F_rep (N + 1, 3), m/s², on the ``own`` predicted positions (N + 1, 3), m.

    Each source is clamped to ``clamp`` m/s². ``braking`` is a_rel (m/s²) of the module's docstring,
    ``reaction`` (s) the time until the vehicle brakes, ``dt`` (s) the step between the predicted positions.
    ``turn`` (rad, counter-clockwise from above) is the rotation of the force of an obstacle that closes at
    ``_CLOSES`` or faster; it is smaller for a slower one.
    """
    if not obstacles.ids:
        return np.zeros_like(own)
    away = own - obstacles.positions
    distance = np.sqrt(np.vecdot(away, away))
    reserve = distance
    if braking is not None:
        spare = np.maximum(distance - obstacles.d_min[:, None], 0.0)
        reserve = distance - np.maximum(stopping_distance(distance, braking, dt, reaction), -spare)
    if (reserve >= obstacles.d_safe[:, None]).all():
        return np.zeros_like(own)
    force = magnitude(reserve, obstacles.d_min[:, None], obstacles.d_safe[:, None], gain, clamp)
    near = distance < _NEAR
    if near.any():
        away[near] = (1.0, 0.0, 0.0)
        distance[near] = 1.0
    if turn:
        away = _turned(away, turn * np.clip(closing_speed(distance, dt) / _CLOSES, 0.0, 1.0))
    result: Array = np.einsum("jn,jni->ni", force / distance, away)
    return result


def _turned(away: Array, angle: Array) -> Array:
    """Return vectors (M, N + 1, 3) rotated about the vertical by ``angle`` (M, N + 1), rad."""
    c, s = np.cos(angle), np.sin(angle)
    turned = away.copy()
    turned[..., 0] = c * away[..., 0] - s * away[..., 1]
    turned[..., 1] = s * away[..., 0] + c * away[..., 1]
    return turned


def closing_speed(distance: Array, dt: float) -> Array:
    """Return how fast distances (M, N + 1), m, shrink, m/s; negative where they grow."""
    closing = np.empty_like(distance)
    np.subtract(distance[:, :-1], distance[:, 1:], out=closing[:, :-1])
    closing[:, -1] = closing[:, -2]
    closing /= dt
    return closing


def stopping_distance(distance: Array, braking: float, dt: float, reaction: float = 0.0) -> Array:
    """Return ċ²/(2 a_rel) + ċ·``reaction`` (M, N + 1), m, from predicted distances (M, N + 1), m.

    ċ is the speed at which they shrink; the result is negative where they grow.
    """
    closing = np.empty_like(distance)
    np.subtract(distance[:, :-1], distance[:, 1:], out=closing[:, :-1])
    closing[:, -1] = closing[:, -2]
    result: Array = closing * np.abs(closing) * (0.5 / (braking * dt**2))
    if reaction:
        result += closing * (reaction / dt)
    return result
