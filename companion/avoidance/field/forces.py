"""Repulsive potential field of the paper, eqs. (9) and (10), over the whole horizon.

F(d) = K · (π/2)/(d_safe − d_min) · (cot z + z − π/2),  z = (π/2)(d − d_min)/(d_safe − d_min)

d is the distance from the obstacle and K the gain. Deviations from the paper: the force points *away* from
the obstacle (the printed α points towards it). Below d_min the formula turns negative, so F has a constant
value there, far above the vehicle's largest acceleration. The sum is limited to a_total, not its parts:
otherwise an obstacle that pushes from behind would cancel one that is about to be hit.

Downwash. Where heights count by a factor 1/w the distance is ‖(Δx, Δy, Δz/w)‖, and the force is still the
negative gradient: F(d) along (Δx, Δy, Δz/w²)/d.

Closing speed. From d_safe = 3 m the bare field cannot stop two vehicles that meet at 5 m/s each: that takes
about 10 m/s² net. So the distance that enters F is what would be left after braking, d − ċ²/(2 a_rel) with ċ
the closing speed and a_rel the relative deceleration to count on. At rest this is the paper's field; at a
high closing speed its reach grows with the square of the speed, and d_min is approached no faster than the
vehicle can brake. With bounded jerk a vehicle brakes late: ``reaction`` seconds of closing are subtracted,
too. Where the distance grows the term is added, until the distance from d_min is doubled: otherwise the field
would push vehicles that separate as hard as vehicles that approach, and accelerate them after every
encounter. ``braking=None`` is the paper's field alone.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt, tan

import numpy as np

from companion.values.compiled import BOOL, FLOAT, VOID, array, kernel, output, part
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles

_CLOSES = 1.0
"""Closing speed (m/s) from which ``turn`` applies in full."""
_NEAR = 1e-6
"""Distance (m) below which no direction points away; the force then points along +x."""
_HALF_TURN = 0.5 * pi


@part
def _magnitude(distance: float, d_min: float, d_safe: float, gain: float, clamp: float) -> float:
    """Return F_hyp(d): 0 from d_safe on, continuous and decreasing, and ``clamp`` at and below d_min."""
    width = d_safe - d_min
    z = min(max(_HALF_TURN * (distance - d_min) / width, 1e-9), _HALF_TURN)
    force = min((gain * _HALF_TURN) * (1.0 / tan(z) + z - _HALF_TURN) / width, clamp)
    return max(force, 0.0)


def magnitude(distance: Array, d_min: Array, d_safe: Array, gain: float, clamp: float) -> Array:
    """Return F_hyp(d), m/s², eq. (9), of arrays that broadcast."""
    distance, d_min, d_safe = np.broadcast_arrays(distance, d_min, d_safe)
    found = np.empty(distance.shape)
    _magnitudes(distance.ravel(), d_min.ravel(), d_safe.ravel(), gain, clamp, found.reshape(-1))
    return found


@kernel(VOID, array(1), array(1), array(1), FLOAT, FLOAT, output(1))
def _magnitudes(
    distance: Array, d_min: Array, d_safe: Array, gain: float, clamp: float, found: Array
) -> None:
    """Write ``magnitude`` to ``found``; all arrays are (n,)."""
    for n in range(len(found)):
        found[n] = _magnitude(distance[n], d_min[n], d_safe[n], gain, clamp)


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
    """Return Σ_j F_rep (N + 1, 3), m/s², eq. (10), on the ``own`` predicted positions (N + 1, 3), m.

    Each source is clamped to ``clamp`` m/s². ``braking`` is a_rel (m/s²) of the module's docstring,
    ``reaction`` (s) the time until the vehicle brakes, ``dt`` (s) the step between the predicted positions.
    ``turn`` (rad, counter-clockwise from above) is the rotation of the force of an obstacle that closes at
    ``_CLOSES`` or faster; it is smaller for a slower one.
    """
    force = np.zeros((len(own), 3))
    if obstacles.ids:
        _repulsion(
            np.ascontiguousarray(own),
            np.ascontiguousarray(obstacles.positions),
            obstacles.d_min,
            obstacles.d_safe,
            np.ascontiguousarray(np.broadcast_to(obstacles.heights, len(obstacles.ids))),
            gain,
            clamp,
            0.0 if braking is None else braking,
            dt,
            reaction,
            turn,
            force,
        )
    return force


@part
def stopping_distance(closing: float, braking: float, reaction: float) -> float:
    """Return ċ²/(2 a_rel) + ċ·``reaction``, m, at the ``closing`` speed ċ (m/s); its sign is that of ċ."""
    return closing * abs(closing) / (2.0 * braking) + closing * reaction


@kernel(VOID, array(2), array(3), *[array(1)] * 3, *[FLOAT] * 6, output(2))
def _repulsion(
    own: Array,
    positions: Array,
    d_min: Array,
    d_safe: Array,
    heights: Array,
    gain: float,
    clamp: float,
    braking: float,
    dt: float,
    reaction: float,
    turn: float,
    force: Array,
) -> None:
    """Add the repulsion by obstacles at ``positions`` (M, N + 1, 3) to ``force`` (N + 1, 3).

    Without ``braking`` it is 0; the other arguments are those of ``repulsion``.
    """
    steps = len(own)
    if positions.shape[1] != steps or len(d_min) != len(positions) or len(d_safe) != len(positions):
        raise ValueError("each obstacle needs a position per predicted position, a d_min and a d_safe")
    away, distance = np.empty((steps, 3)), np.empty(steps)
    for j in range(len(positions)):
        for n in range(steps):
            square = 0.0
            for i in range(3):
                away[n, i] = own[n, i] - positions[j, n, i]
                if i == 2:
                    away[n, i] *= heights[j]
                square += away[n, i] * away[n, i]
            distance[n] = sqrt(square)
        for n in range(steps):
            # The last step continues at the closing speed of the step before.
            step = min(n, steps - 2)
            closing = (distance[step] - distance[step + 1]) / dt
            reserve = distance[n]
            if braking > 0.0:
                spare = max(distance[n] - d_min[j], 0.0)
                reserve -= max(stopping_distance(closing, braking, reaction), -spare)
            if reserve >= d_safe[j]:
                continue
            size = _magnitude(reserve, d_min[j], d_safe[j], gain, clamp)
            x, y, z = away[n]
            if distance[n] < _NEAR:
                x, y, z = 1.0, 0.0, 0.0
            else:
                size /= distance[n]
            if turn != 0.0:
                angle = turn * min(max(closing / _CLOSES, 0.0), 1.0)
                x, y = cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y
            force[n, 0] += size * x
            force[n, 1] += size * y
            # The gradient of the distance: heights that count less push less, too.
            force[n, 2] += size * z * heights[j]


def smoothed(force: Array, most: float, last: Array, share: float, *, planar: bool) -> Array:
    """Return ``force`` (N + 1, 3) limited in norm to ``most`` (m/s²) and moved from ``last`` by a ``share``.

    At a ``share`` of 1 the limited force is returned, at 0 ``last`` (N + 1, 3). ``planar`` forces have no
    vertical component.
    """
    found = np.empty_like(force)
    _smoothed(force, most, last, share, planar, found)
    return found


@kernel(VOID, array(2), FLOAT, array(2), FLOAT, BOOL, output(2))
def _smoothed(force: Array, most: float, last: Array, share: float, planar: bool, found: Array) -> None:
    """Write ``smoothed`` to ``found`` (N + 1, 3)."""
    for n in range(len(force)):
        x, y, z = force[n]
        if planar:
            z = 0.0
        scale = most / max(sqrt(x * x + y * y + z * z), most)
        found[n, 0] = last[n, 0] + share * (scale * x - last[n, 0])
        found[n, 1] = last[n, 1] + share * (scale * y - last[n, 1])
        found[n, 2] = last[n, 2] + share * (scale * z - last[n, 2])
