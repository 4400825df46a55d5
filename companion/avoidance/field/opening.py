"""Opening of the QPs' bounds: limits of position and speed have priority over the field.

Where the bounds shifted by the field leave no input that keeps these limits, the bounds on a are opened
towards what the vehicle can do: first as late in the horizon as possible, so that a vehicle evades with the
full field until its speed or its braking distance allows no more (``_late``), and then as little as
necessary. Only a limit that even this cannot keep is widened to what is reachable.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from companion.values.compiled import FLOAT, VOID, array, kernel, output, part
from companion.values.horizon import Array

_TOLERANCE = 1e-7
"""Violation of a state limit (m, m/s) that is tolerated: far below what can be measured."""
_SPARE, _SLOWER, _INSIDE = 0.5, 0.02, 0.05
"""Margins where bounds yield to limits.

They are the share of the largest deceleration that is counted on, m/s below the largest speed, and m inside
the box.
"""
_WIDEN = 0.01
"""Share of the reachable range by which bounds open more than necessary: PIQP needs an interior."""


@part
def _rows_of(a: Array, dt: float, rows: Array) -> None:
    """Write G a (2n,) to ``rows``: velocities and positions by accelerations ``a`` (n,) from rest at 0."""
    n = len(a)
    x = v = 0.0
    for k in range(n):
        x += dt * (v + 0.5 * dt * a[k])
        v += dt * a[k]
        rows[k], rows[n + k] = v, x


@part
def _late(
    pushed: Array,
    least: Array,
    room: float,
    v: float,
    fastest: float,
    away: float,
    jerk: float,
    dt: float,
    step: float,
    last: float,
    found: Array,
) -> None:
    """Write to ``found`` (n,) accelerations as ``pushed`` (n,) until speed or braking distance allow no more.

    They point towards a side that is ``room`` m away, approached at ``v`` m/s; ``fastest`` is the largest
    speed towards it, ``away`` that away from it, m/s. Without a bound on ``jerk``, which is then 0, they are
    not less than ``least`` (n,). With one they continue the acceleration ``last`` within it; ``step`` (s) is
    the time for the first change.
    """
    n = len(pushed)
    place = room - _INSIDE
    strong = -_SPARE * min(least[n - 1], 0.0)
    lost = dt if jerk == 0.0 else dt + strong / (2.0 * jerk)
    for k in range(n):
        stop = sqrt(2.0 * strong * max(place - lost * max(v, 0.0), 0.0))
        rest = min(fastest, stop) - v
        # A vehicle that moves away from that side too fast must be slowed down first.
        a = max(pushed[k], (-away - v) / dt)
        if jerk == 0.0:
            a = max(min(a, rest / dt), least[k])
        else:
            # v + dt a + a²/2j, the speed when a has come back to zero, stays below.
            if rest > 0.0:
                a = min(a, jerk * (sqrt(dt * dt + 2.0 * rest / jerk) - dt))
            else:
                a = min(a, max(rest / dt, -sqrt(-jerk * rest)))
            a = min(max(a, last - jerk * step), last + jerk * step)
            last, step = a, dt
        found[k] = a
        place -= dt * (v + 0.5 * dt * a)
        v += dt * a


@part
def _share_to_open(missing: Array, room: Array, margin: Array, dt: float, gain: Array) -> float:
    """Return the share (0…1) of its ``room`` (n,) by which a bound on a gives way.

    The positions then gain what is ``missing`` (2n,), and a ``margin`` (2n,) in addition. Speed has been
    treated before: a vehicle that is still too fast cannot be slowed down in time. ``gain`` (2n,) is scratch
    memory.
    """
    n, share = len(room), 0.0
    _rows_of(room, dt, gain)
    for k in range(n, 2 * n):
        if missing[k] > _TOLERANCE:
            share = max(share, (missing[k] + margin[k]) / max(gain[k], _TOLERANCE))
    return min(share, 1.0)


@kernel(VOID, *[array(2)] * 6, array(1), *[FLOAT] * 2, array(1), *[output(2)] * 4)
def open_bounds(
    reach_l: Array,
    reach_u: Array,
    far_l: Array,
    far_u: Array,
    lowest: Array,
    highest: Array,
    j_max: Array,
    dt: float,
    step: float,
    flown: Array,
    x_l: Array,
    x_u: Array,
    h_l: Array,
    h_u: Array,
) -> None:
    """Open the bounds of a ``Problem`` in place as ``Dqmpc.reachable`` describes.

    ``reach_l``, ``reach_u`` (3, n): accelerations that a bound on jerk allows; without one ``j_max`` (3,) is
    0. ``lowest``, ``highest`` (3, 2n): limits of velocities and positions. ``flown`` (3,): the acceleration
    that the plan continues, with ``step`` (s) for its first change.
    """
    n = far_l.shape[1]
    low, high, least, most = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    rows, gain, margin, late = np.empty(2 * n), np.empty(2 * n), np.empty(2 * n), np.empty(n)
    for i in range(3):
        for k in range(n):
            low[k] = min(max(x_l[i, k], reach_l[i, k]), reach_u[i, k])
            high[k] = max(min(x_u[i, k], reach_u[i, k]), reach_l[i, k])
            least[k] = min(min(max(far_l[i, k], reach_l[i, k]), reach_u[i, k]), low[k])
            most[k] = max(max(min(far_u[i, k], reach_u[i, k]), reach_l[i, k]), high[k])
        # The state that the plan begins with, recovered from the drift in the rows.
        v = lowest[i, 0] - h_l[i, 0]
        x = lowest[i, 2 * n - 1] - h_l[i, 2 * n - 1] - n * dt * v
        up, down = highest[i, 0] - _SLOWER, -lowest[i, 0] - _SLOWER
        _rows_of(high, dt, rows)
        if (h_l[i] > rows + _TOLERANCE).any():
            room = x - lowest[i, 2 * n - 1]
            _late(-high, -most, room, -v, down, up, j_max[i], dt, step, -flown[i], late)
            for k in range(n):
                high[k] = max(high[k], -late[k])
        _rows_of(low, dt, rows)
        if (rows > h_u[i] + _TOLERANCE).any():
            room = highest[i, 2 * n - 1] - x
            _late(low, least, room, v, up, down, j_max[i], dt, step, flown[i], late)
            for k in range(n):
                low[k] = min(low[k], late[k])
        _rows_of(most - least, dt, margin)
        margin *= _WIDEN
        _rows_of(high, dt, rows)
        high += _share_to_open(h_l[i] - rows, most - high, margin, dt, gain) * (most - high)
        _rows_of(low, dt, rows)
        low -= _share_to_open(rows - h_u[i], low - least, margin, dt, gain) * (low - least)
        # A limit that cannot be kept even so is widened to slightly beyond what is reachable.
        _rows_of(low, dt, rows)
        _rows_of(high, dt, gain)
        for k in range(2 * n):
            spare = _WIDEN * (gain[k] - rows[k])
            h_l[i, k] = min(h_l[i, k], gain[k] - spare)
            h_u[i, k] = max(h_u[i, k], rows[k] + spare)
        for k in range(n):
            x_l[i, k] = min(low[k], x_l[i, k])
            x_u[i, k] = max(high[k], x_u[i, k])
