"""Walls of the box and largest speeds, held on each axis by the plan that the QPs gave.

The QPs look only as far as the horizon, and where their constraints contradict each other, as a field that
turns in an instant can make them, they give up state limits. Here no limit is given up. A plan is amended on
an axis where it leaves the box or exceeds v_min or v_max within the time for which it may be flown, or where
its first step leads to a state from which the vehicle could not stop before the wall. The plan then moves
towards the wall no faster than it can stop, and along the wall as the QPs say: the push through the wall is
dropped.

Near the floor the field itself is turned: what pushes down pushes sideways (``aside``).

Stopping counts on 1/√3 of ``a_total`` at most, which a vehicle has on all axes at once, and never more than
the larger of the bound of u in that direction and half of ``a_total``. A plan that begins beyond a wall is
kept from going further. The first step of a plan and all steps of an amended axis keep a wall at all times,
as far as braking allows, the other steps at the knots.
"""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np

from companion.config.planning import LimitsConfig
from companion.values.compiled import FLOAT, INT, array, kernel, output, part
from companion.values.horizon import Array

_TOLERANCE = 1e-6
"""Violation (m, m/s) that is tolerated: far below what can be measured."""
_HALVINGS = 40
_SIDEWAYS_M = 1.5
"""Height (m) above the floor below which a push down begins to be turned aside; at the floor all of it is."""
_KEPT = 0.3
"""Weight of the last direction, and of each m/s of velocity, against the push's horizontal share (0…1)."""
_LEVEL = 1e-6
"""A smaller sum of these has no direction."""


class Walls:
    """Walls of the box of ``limits`` and its speeds, for plans in steps of ``dt`` (s).

    A plan is flown for ``flown_s`` (s) at most.
    """

    def __init__(self, limits: LimitsConfig, dt: float, flown_s: float) -> None:
        self._side: Array = np.zeros(2)
        self._checked = ceil(flown_s / dt) + 1
        self._low, self._high = np.array(limits.box_min), np.array(limits.box_max)
        # Of the motions to the high and to the low wall: (2, 3).
        self._fastest = np.array([limits.v_max, np.negative(limits.least_v)])
        self._a_total, self._dt = limits.a_total, dt
        most = limits.a_total / sqrt(3.0)
        inputs = np.array([np.negative(limits.least_u), limits.u_max])
        self._braking: Array = np.minimum(np.maximum(inputs, 0.5 * limits.a_total), most)
        self._jerk = np.zeros(3) if limits.j_max is None else np.array(limits.j_max)

    def aside(self, force: Array, heights: Array, velocity: Array, onward: Array) -> Array:
        """Return the field ``force`` (N + 1, 3), m/s², with the push through the floor turned aside.

        ``heights`` (N + 1,), m: where it acts. Near the floor there is no room below, so what pushes down
        pushes sideways: where the horizontal push and ``velocity`` (3,) lead, without both towards ``onward``
        (3,), m, and without that along +x. The direction is kept from call to call, or an obstacle exactly
        above would push to all sides in turn.
        """
        if not ((heights < self._low[2] + _SIDEWAYS_M) & (force[:, 2] < 0.0)).any():
            self._side = np.zeros(2)
            return force
        sizes = np.maximum(np.sqrt(np.einsum("ni,ni->n", force, force)), _LEVEL)
        towards = (force[:, :2] / sizes[:, None]).mean(axis=0) + _KEPT * (self._side + velocity[:2])
        for direction in (towards, onward[:2], np.array([1.0, 0.0])):
            size = float(np.sqrt(direction @ direction))
            if size > _LEVEL:
                self._side = direction / size
                break
        share = np.minimum(np.maximum(1.0 - (heights - self._low[2]) / _SIDEWAYS_M, 0.0), 1.0)
        push = share * np.maximum(-force[:, 2], 0.0)
        turned: Array = force + push[:, None] * np.append(self._side, 1.0)
        return turned

    def keep(self, x: Array, v: Array, flown: Array, elapsed: float, a: Array) -> int:
        """Amend the accelerations ``a`` (n, 3), m/s², in place; return the number of amended axes.

        They are those of a plan from ``x``, ``v`` (3,) on. It continues the acceleration ``flown`` (3,), with
        ``elapsed`` (s) for its first change, where jerk is bounded.
        """
        step = min(elapsed, self._dt)
        limits = self._low, self._high, self._fastest, self._braking, self._jerk
        return _keep(x, v, flown, *limits, self._a_total, self._dt, step, self._checked, a)


@part
def _stopping(v: float, a: float, braking: float, jerk: float, dt: float) -> float:
    """Return the distance (m) to stop from a speed ``v`` at an acceleration ``a``, both towards the wall.

    The acceleration changes by ``jerk`` (0: at once) until ``braking`` decelerates the vehicle.
    """
    if jerk == 0.0:
        return v * v / (2.0 * braking) + v * dt if v > 0.0 else 0.0
    a = max(a, -braking)
    square = a * a + 2.0 * jerk * v
    if square <= 0.0 or (v <= 0.0 and a <= 0.0):
        return 0.0
    time = min((a + sqrt(square)) / jerk, (a + braking) / jerk)
    reached = v + time * (a - 0.5 * jerk * time)
    distance = time * (v + time * (0.5 * a - jerk * time / 6.0))
    return distance + max(reached, 0.0) ** 2 / (2.0 * braking) + max(v, 0.0) * dt


@part
def _safe(room: float, v: float, a: float, fastest: float, braking: float, jerk: float, dt: float) -> bool:
    """Return whether a vehicle that has flown a step at ``a`` can keep the wall and the largest speed.

    The step began at a speed ``v``, ``room`` (m) from the wall. With a bound on jerk the speed grows until
    the acceleration has come back to zero.
    """
    speed, left = v + dt * a, room - dt * (v + 0.5 * dt * a)
    growth = max(a * (a / jerk - dt), 0.0) / 2.0 if jerk > 0.0 and a > 0.0 else 0.0
    if speed + growth > fastest + _TOLERANCE:
        return False
    if v > 0.0 and speed < 0.0 and room + v * v / (2.0 * a) < -_TOLERANCE:
        # It turns back within the step, after its nearest point. A plan that is replaced between two knots
        # leaves a state with less room than at a knot, where a step that ends at the wall may turn beyond it.
        return False
    return left >= _stopping(speed, a, braking, jerk, dt) - _TOLERANCE


@part
def _slowed(
    room: float, v: float, a: float, least: float, fastest: float, braking: float, jerk: float, dt: float
) -> float:
    """Return the largest acceleration from ``least`` to ``a`` that is safe; ``least`` if none is."""
    if a <= least or _safe(room, v, a, fastest, braking, jerk, dt):
        return a
    low, high = least, a
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _safe(room, v, middle, fastest, braking, jerk, dt):
            low = middle
        else:
            high = middle
    return low


@part
def _binds(
    x: float,
    v: float,
    low: float,
    high: float,
    fastest: Array,
    braking: Array,
    jerk: float,
    dt: float,
    checked: int,
    a: Array,
) -> bool:
    """Return whether ``a`` (n,) breaks a limit in ``checked`` steps, or begins with one that will.

    ``fastest``, ``braking`` (2,): of motions to the high and to the low wall.
    """
    below, above = min(low, x), max(high, x)
    if not _safe(x - below, -v, -a[0], fastest[1], braking[1], jerk, dt):
        return True
    if not _safe(above - x, v, a[0], fastest[0], braking[0], jerk, dt):
        return True
    for k in range(min(checked, len(a))):
        x += dt * (v + 0.5 * dt * a[k])
        v += dt * a[k]
        if x < below - _TOLERANCE or x > above + _TOLERANCE:
            return True
        if v > fastest[0] + _TOLERANCE or -v > fastest[1] + _TOLERANCE:
            return True
    return False


@kernel(INT, *[array(1)] * 5, *[array(2)] * 2, array(1), *[FLOAT] * 3, INT, output(2))
def _keep(
    place: Array,
    velocity: Array,
    flown: Array,
    lowest: Array,
    highest: Array,
    speeds: Array,
    brakings: Array,
    jerks: Array,
    a_total: float,
    dt: float,
    step: float,
    checked: int,
    a: Array,
) -> int:
    """Amend ``a`` (n, 3) as ``Walls.keep`` says; ``step`` (s) is the time for the first change.

    ``speeds``, ``brakings`` (2, 3): of motions to the high and to the low wall.
    """
    n, amended = len(a), 0
    axis = np.empty(n)
    for i in range(3):
        x, v, jerk = place[i], velocity[i], jerks[i]
        fastest, braking = speeds[:, i], brakings[:, i]
        for k in range(n):
            axis[k] = a[k, i]
        if not _binds(x, v, lowest[i], highest[i], fastest, braking, jerk, dt, checked, axis):
            continue
        amended |= 1 << i
        below, above = min(lowest[i], x), max(highest[i], x)
        last, change = flown[i], jerk * step
        for k in range(n):
            # The braking of three axes at once is within a_total.
            least, most = -braking[0], braking[1]
            wanted = min(max(a[k, i], least), most)
            if jerk > 0.0:
                wanted = min(max(wanted, last - change), last + change)
                least, most = max(least, last - change), min(most, last + change)
            wanted = _slowed(above - x, v, wanted, least, fastest[0], braking[0], jerk, dt)
            wanted = -_slowed(x - below, -v, -wanted, -most, fastest[1], braking[1], jerk, dt)
            a[k, i] = wanted
            x += dt * (v + 0.5 * dt * wanted)
            v += dt * wanted
            last, change = wanted, jerk * dt
    if amended == 0:
        return 0
    # What is left of a_total is for the other axes; a bound on their jerk comes before it.
    for k in range(n):
        held = free = 0.0
        for i in range(3):
            if amended >> i & 1:
                held += a[k, i] * a[k, i]
            else:
                free += a[k, i] * a[k, i]
        if held + free <= a_total * a_total or free == 0.0:
            continue
        scale = sqrt(max(a_total * a_total - held, 0.0) / free)
        for i in range(3):
            if not amended >> i & 1:
                least = scale * a[k, i]
                if jerks[i] > 0.0:
                    last, change = (flown[i], jerks[i] * step) if k == 0 else (a[k - 1, i], jerks[i] * dt)
                    least = min(max(least, last - change), last + change)
                a[k, i] = least
    return (amended & 1) + (amended >> 1 & 1) + (amended >> 2 & 1)
