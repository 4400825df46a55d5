"""Bounds on the speed of a plan beside places that it must not come near, and plans slowed down to them.

At a gap g from such a place a vehicle flies, in every direction, no faster than

    w(g) = g/T up to g = b T²/2,  √(b g − b² T²/4) beyond it,

and towards it no faster than it can stop within g. If two vehicles keep w at the gap between them, it shrinks
by at most 2 w: each decelerates by b at most, and because w is at most g/T the gap never closes.

Where g is 0, w is 0 in every direction. A vehicle that is already too near to another one would stay there:
it may therefore fly away from it with a small speed, in every direction in which it comes no nearer.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from companion.values.compiled import FLOAT, VOID, array, kernel, output, part
from companion.values.horizon import Array

REACTION_S = 0.2
"""s at the present speed before a vehicle brakes: a plan, a set-point, and the tilt."""
_ROUNDS = 4
"""Rounds of projections; what they leave over is scaled away."""
_LEVEL = 1e-9


class SpeedBounds(NamedTuple):
    """K places that a vehicle at ``place`` (3,), m, must not come near.

    ``normals`` (K, 3): by how much (m/m) each gap shrinks with a motion along each axis. They point at the
    places and are unit vectors at most: distances are those of an ellipsoid, where a metre of height counts
    less, and for flights at one height the vertical parts are 0.
    ``gaps`` (K,), m: how far the places are in that measure, at least 0.
    ``floors`` (K,), m/s: speed that is allowed beside each at any gap, other than towards it.
    ``leaving`` (K,), m/s: speed that is allowed at any gap in directions in which the vehicle comes no nearer
    to the place. ``braking`` (m/s²) is b and ``time`` (s) is T.
    """

    place: Array
    normals: Array
    gaps: Array
    floors: Array
    leaving: Array
    braking: float
    time: float

    def along(self, towards: Array) -> float:
        """Return the speed (m/s) that is allowed at ``place`` in the direction ``towards`` (3,)."""
        size = float(np.sqrt(towards @ towards))
        if size < _LEVEL or not len(self.gaps):
            return inf
        fastest = np.maximum(allowed(self.gaps, self.braking, self.time), self.floors)
        closing = self.normals @ (towards / size)
        ahead = closing > _LEVEL
        fastest = np.where(ahead, fastest, np.maximum(fastest, self.leaving))
        reach = self.braking * REACTION_S
        stopping = np.sqrt(reach * reach + 2.0 * self.braking * self.gaps[ahead]) - reach
        return float(min(fastest.min(), (stopping / closing[ahead]).min(initial=inf)))


class Slowing:
    """Plans in steps of ``dt`` (s), slowed down with at most ``a_total`` (m/s²), and ``j_max`` (m/s³)."""

    def __init__(self, dt: float, a_total: float, j_max: tuple[float, float, float] | None) -> None:
        self._dt, self._a_total = dt, a_total
        self._jerk = np.zeros(3) if j_max is None else np.array(j_max)

    def keep(self, x: Array, v: Array, flown: Array, elapsed: float, bounds: SpeedBounds, a: Array) -> None:
        """Amend the accelerations ``a`` (n, 3), m/s², in place, so that the plan keeps ``bounds``.

        It begins at ``x``, ``v`` (3,). Where jerk is bounded it continues the acceleration ``flown`` (3,),
        with ``elapsed`` (s) for its first change. A plan that begins too fast slows down as fast as it may.
        The direction is kept, but for what leads to a place.
        """
        _keep(
            x,
            v,
            flown,
            bounds.place,
            bounds.normals,
            bounds.gaps,
            bounds.floors,
            bounds.leaving,
            self._jerk,
            self._a_total,
            self._dt,
            min(elapsed, self._dt),
            bounds.braking,
            bounds.time,
            a,
        )


def allowed(gaps: Array, braking: float, time: float) -> Array:
    """Return w (K,), m/s, of the module's docstring at ``gaps`` (K,), m, with b and T."""
    found = np.empty(len(gaps))
    _write_allowed(gaps, braking, time, found)
    return found


@part
def _allowed(gap: float, braking: float, time: float) -> float:
    if 2.0 * gap <= braking * time * time:
        return gap / time
    return sqrt(braking * gap - 0.25 * (braking * time) ** 2)


@kernel(VOID, array(1), FLOAT, FLOAT, output(1))
def _write_allowed(gaps: Array, braking: float, time: float, found: Array) -> None:
    """Write ``allowed`` to ``found`` (K,)."""
    for j in range(len(gaps)):
        found[j] = _allowed(gaps[j], braking, time)


@part
def _closing(normals: Array, j: int, velocity: Array) -> float:
    """Return the speed (m/s) towards place ``j``."""
    speed: float = normals[j, 0] * velocity[0] + normals[j, 1] * velocity[1] + normals[j, 2] * velocity[2]
    return speed


@part
def _norm(velocity: Array) -> float:
    return sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2])


@kernel(VOID, *[array(1)] * 4, array(2), *[array(1)] * 4, *[FLOAT] * 5, output(2))
def _keep(
    place: Array,
    velocity: Array,
    flown: Array,
    origin: Array,
    normals: Array,
    gaps: Array,
    floors: Array,
    leaving: Array,
    jerks: Array,
    a_total: float,
    dt: float,
    step: float,
    braking: float,
    time: float,
    a: Array,
) -> None:
    """Amend ``a`` (n, 3) as ``Slowing.keep`` says; ``step`` (s) is the time for the first change."""
    x, v, last, w = place.copy(), velocity.copy(), flown.copy(), np.empty(3)
    towards, beside = np.empty(len(gaps)), np.empty(len(gaps))
    reach = braking * REACTION_S
    for k in range(len(a)):
        for j in range(len(gaps)):
            gap = gaps[j] - _closing(normals, j, x - origin) - dt * max(_closing(normals, j, v), 0.0)
            gap = max(gap, 0.0)
            towards[j] = sqrt(reach * reach + 2.0 * braking * gap) - reach
            beside[j] = max(_allowed(gap, braking, time), floors[j])
        for i in range(3):
            w[i] = v[i] + dt * a[k, i]
        for _ in range(_ROUNDS):
            for j in range(len(gaps)):
                over = max(_closing(normals, j, w) - towards[j], 0.0)
                over /= max(_closing(normals, j, normals[j]), _LEVEL)
                for i in range(3):
                    w[i] -= over * normals[j, i]
        scale, speed = 1.0, max(_norm(w), _LEVEL)
        for j in range(len(gaps)):
            closing = _closing(normals, j, w)
            if closing > _LEVEL * speed:
                scale = min(scale, beside[j] / speed, towards[j] / closing)
            else:
                scale = min(scale, max(beside[j], leaving[j]) / speed)
        size = 0.0
        for i in range(3):
            w[i] = (scale * w[i] - v[i]) / dt
            size += w[i] * w[i]
        most = min(a_total / max(sqrt(size), _LEVEL), 1.0)
        for i in range(3):
            wanted = most * w[i]
            if jerks[i] > 0.0:
                change = jerks[i] * (step if k == 0 else dt)
                wanted = min(max(wanted, last[i] - change), last[i] + change)
            a[k, i] = last[i] = wanted
            x[i] += dt * (v[i] + 0.5 * dt * wanted)
            v[i] += dt * wanted
