"""DQMPC of the paper, eqs. (2) to (7), as three QPs of N + 1 variables each: x, y and z decouple.

Deviations from the paper. The variable is the total acceleration a = u + f, because cost and dynamics depend
on nothing else: f only shifts the bounds, a ∈ [f + u_min, f + u_max]. Gravity is absent: u is relative to
hover, and the vehicle's controller carries the weight (with g in the dynamics and |u| ≤ 2 the problem has no
solution). The vehicle's own bound, ‖u + f‖ ≤ a_total, holds for every solution, unless the bounds on jerk
contradict it: the box of a is cut to |a_i| ≤ |f_i| + u_max,i, scaled down until its corners lie in that ball.

Box and speed limits have priority over the field. Where the bounds shifted by f leave no input that keeps
these limits, the bounds are opened towards what the vehicle can do: first as late in the horizon as possible,
so that a vehicle evades with the full field until its speed or its braking distance allows no more
(``_late``), and then as little as necessary. Only a limit that even this cannot keep is widened to what is
reachable. A QP that still has no solution is solved without state limits (``solve``). With ``j_max`` the jerk
is bounded, too (``jerk``).
"""

from __future__ import annotations

from functools import lru_cache
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.field.jerk import Flown, JerkRows
from companion.avoidance.solver import QpSolver
from companion.config.planning import CostConfig, HorizonConfig, LimitsConfig
from companion.errors import SolverError
from companion.values.compiled import FLOAT, INT, VOID, array, kernel, output, part
from companion.values.horizon import Array
from companion.values.prediction import prediction

_TOLERANCE = 1e-7
"""Violation of a state limit (m, m/s) that is tolerated: far below what can be measured."""
_SPARE, _SLOWER, _INSIDE = 0.5, 0.02, 0.05
"""Margins where bounds yield to limits.

They are the share of the largest deceleration that is counted on, m/s below v_max, and m inside the box.
"""
_WIDEN = 0.01
"""Share of the reachable range by which bounds open more than necessary: PIQP needs an interior."""


class AxisQp(NamedTuple):
    """QP of one axis: min ½ aᵀPa + cᵀa, x_l ≤ a ≤ x_u, h_l ≤ Ga ≤ h_u."""

    P: Array
    c: Array
    G: Array
    h_l: Array
    h_u: Array
    x_l: Array
    x_u: Array


class Problem(NamedTuple):
    """Vectors of the three QPs, (3, n) and (3, 2n).

    They are c, the bounds of a, and the bounds of velocities and positions 1…N + 1. ``far`` (3, n): the
    largest |a| that the vehicle has on that axis, in either direction: |f| + u_max, scaled to at most a_total
    in norm. ``flown``: the motion that the plan continues, where jerk is bounded.
    """

    c: Array
    x_l: Array
    x_u: Array
    h_l: Array
    h_u: Array
    far: Array
    flown: Flown | None = None


class Solution(NamedTuple):
    """Total ``acceleration`` a = u + f (N + 1, 3), m/s²; eq. (1) with the field.

    ``relaxed`` counts axes on which constraints had to be dropped, mostly state limits.
    """

    acceleration: Array
    relaxed: int


class _Solvers(NamedTuple):
    """Solvers for one weight Ω_t: −P⁻¹ (n, n), the QP without state limits, and the QP with them."""

    minimiser: Array
    bounded: QpSolver
    limited: QpSolver


class Dqmpc:
    """Matrices and solvers for one horizon, cost and set of limits.

    ``omega_scale`` lowers Ω_t (tangential band).
    """

    def __init__(self, horizon: HorizonConfig, cost: CostConfig, limits: LimitsConfig) -> None:
        n = horizon.steps + 1
        dt = horizon.dt_us * 1e-6
        self.n, self.dt, self.cost, self.limits = n, dt, cost, limits
        self.S_v, self.S_x, _ = prediction(n, dt)
        self.G: Array = np.vstack([self.S_v, self.S_x])
        self._jerk = None if limits.j_max is None else JerkRows(n, dt, np.array(limits.j_max))
        self._u_max: Array = np.array(limits.u_max)
        ones = np.ones(n)
        self._low, self._high = (
            np.hstack([np.outer(speed, ones), np.outer(place, ones)])
            for speed, place in (
                (-np.array(limits.v_max), limits.box_min),
                (np.array(limits.v_max), limits.box_max),
            )
        )
        # [x − x̌, v − v̌] (3, 2) at the end for a = 0, times this, gives c for Ω_t as configured.
        weights = 2.0 * np.array([cost.omega_t_position, cost.omega_t_velocity])
        self._pull: Array = weights[:, None] * np.vstack([self.S_x[-1], self.S_v[-1]])
        self._ratio_i = cost.omega_i / cost.omega_t_position
        self._ratio_v = cost.omega_t_velocity / cost.omega_t_position
        self._solvers = lru_cache(maxsize=16)(self._build)

    def hessian(self, omega_scale: float) -> Array:
        """Return P = 2(Ω_i I + Ω_x s_x s_xᵀ + Ω_v s_v s_vᵀ), with Ω_x and Ω_v times ``omega_scale``.

        s_x and s_v (n,) map a to position and velocity at the end. PIQP works best with weights between 1e2
        and 1e3.
        """
        s_x, s_v = self.S_x[-1], self.S_v[-1]
        w = self.cost
        return 2.0 * (
            w.omega_i * np.eye(self.n)
            + omega_scale
            * (w.omega_t_position * np.outer(s_x, s_x) + w.omega_t_velocity * np.outer(s_v, s_v))
        )

    def problem(
        self,
        x: Array,
        v: Array,
        f: Array,
        destination: Array,
        velocity: Array,
        omega_scale: float,
        flown: Flown | None = None,
    ) -> Problem:
        """Return the vectors of the QPs from the state and the field.

        The state is ``x``, ``v`` (3,), the field ``f`` (N + 1, 3), the destination x̌ (3,) and the terminal
        ``velocity`` (3,). ``flown`` counts where jerk is bounded; without it the plan starts from zero
        acceleration.
        """
        if self._jerk is not None and flown is None:
            flown = Flown(np.zeros(3), self.dt)
        n = self.n
        found = Problem(
            np.empty((3, n)),
            np.empty((3, n)),
            np.empty((3, n)),
            np.empty((3, 2 * n)),
            np.empty((3, 2 * n)),
            np.empty((3, n)),
            flown,
        )
        _vectors(
            x,
            v,
            np.ascontiguousarray(f),
            destination,
            velocity,
            self._u_max,
            self.limits.a_total,
            self.dt,
            omega_scale * self._pull,
            self._low,
            self._high,
            *found[:6],
        )
        return found

    def reachable(self, problem: Problem) -> Problem:
        """Return the problem with state limits that can be kept.

        First the bounds on a are opened for the limits, as late and as little as necessary. A limit that no
        input keeps even then is widened until some inputs keep it, with a small margin.
        """
        jerk, step, last = _NO_JERK, self.dt, _NO_JERK
        least, most = -problem.far, problem.far
        if self._jerk is not None and problem.flown is not None:
            jerk, last = self._jerk.j_max, problem.flown.acceleration
            step = min(problem.flown.elapsed, self.dt)
            least, most = self._jerk.reach(problem.flown)
        opened = problem._replace(
            x_l=problem.x_l.copy(), x_u=problem.x_u.copy(), h_l=problem.h_l.copy(), h_u=problem.h_u.copy()
        )
        _open(least, most, problem.far, self._low, self._high, jerk, self.dt, step, last, *opened[1:5])
        return opened

    def axis(self, problem: Problem, axis: int, omega_scale: float) -> AxisQp:
        """Return the QP of one axis in full, for another solver or a KKT check."""
        problem = self.reachable(problem)
        low, high = self._rows(problem)
        return AxisQp(
            self.hessian(omega_scale),
            problem.c[axis],
            self.G if self._jerk is None else np.vstack([self.G, self._jerk.D]),
            low[axis],
            high[axis],
            problem.x_l[axis],
            problem.x_u[axis],
        )

    def _rows(self, problem: Problem) -> tuple[Array, Array]:
        """Return bounds (3, m) of all rows: velocities, positions and, with bounded jerk, changes of a."""
        if self._jerk is None or problem.flown is None:
            return problem.h_l, problem.h_u
        d_l, d_u = self._jerk.bounds(problem.flown)
        return np.hstack([problem.h_l, d_l]), np.hstack([problem.h_u, d_u])

    def solve(self, problem: Problem, omega_scale: float) -> Solution:
        """Solve the three axes, each with no more constraints than necessary.

        The free minimiser is the solution where it lies within the bounds on a and on jerk. Otherwise PIQP
        solves with these bounds, and once more with all constraints where that solution breaks a state limit.
        An axis whose constraints contradict each other is solved without its state limits and counted. Its
        bounds on a and on jerk still hold; where these contradict each other, the bounds on jerk hold. Raises
        SolverError only if even that fails.
        """
        solvers = self._solvers(omega_scale)
        c, x_l, x_u, h_l, h_u = problem[:5]
        a = np.empty((self.n, 3))
        inside = _free_minimiser(solvers.minimiser, c, x_l, x_u, a)
        relaxed = 0
        if self._jerk is None or problem.flown is None:
            if inside != _ALL:
                for i in _axes(inside):
                    a[:, i] = solvers.bounded.solve(c[i], x_l[i], x_u[i])
        else:
            d_l, d_u = self._jerk.bounds(problem.flown)
            change = self._jerk.D @ a
            inside &= _as_bits((change >= d_l.T) & (change <= d_u.T))
            for axis in _axes(inside):
                a[:, axis], failed = self._bounded(
                    solvers.bounded, self._jerk, problem, axis, d_l[axis], d_u[axis]
                )
                relaxed += failed
        kept = _kept(a, self.dt, h_l, h_u)
        if kept != _ALL:
            opened = self.reachable(problem)
            low, high = self._rows(opened)
            for i in _axes(kept):
                try:
                    a[:, i] = solvers.limited.solve(c[i], opened.x_l[i], opened.x_u[i], low[i], high[i])
                except SolverError:
                    relaxed += 1
            x_l, x_u = x_l.copy(), x_u.copy()
            x_l[_axes(kept)], x_u[_axes(kept)] = opened.x_l[_axes(kept)], opened.x_u[_axes(kept)]
        if self._jerk is None:
            # PIQP keeps bounds to 1e-8: this clips the rest.
            _clip(x_l, x_u, a)
        return Solution(a, relaxed)

    def _bounded(
        self, solver: QpSolver, jerk: JerkRows, problem: Problem, i: int, low: Array, high: Array
    ) -> tuple[Array, bool]:
        """Solve one axis with bounds on a and on jerk; also return whether these contradict each other.

        If they do, the bounds on jerk hold, and a follows, as fast as they allow, the acceleration of the
        smallest magnitude within the bounds on a.
        """
        try:
            return solver.solve(problem.c[i], problem.x_l[i], problem.x_u[i], low, high), False
        except SolverError:
            middle = np.minimum(np.maximum(0.0, problem.x_l[i]), problem.x_u[i])
            return jerk.limited(middle, low, high), True

    def gradient(self, a: Array, x_end: Array, v_end: Array, destination: Array, velocity: Array) -> Array:
        """Return ∇J = ∂J/∂x(N+1) + ∂J/∂u(N), eq. (11), as a vector (3,), divided by Ω_t (Sec. III-D.1).

        The paper adds a state gradient and an input gradient, which differ in size: here the state gradient
        is the one by the position alone. The division makes k_s and k_tang fit any scale of the weights. The
        gradient vanishes for a plan that ends at the destination with the terminal velocity and a(N) = 0.
        """
        found = np.empty(3)
        _gradient(a[-1], x_end, v_end, destination, velocity, self.dt, self._ratio_i, self._ratio_v, found)
        return found

    def _build(self, omega_scale: float) -> _Solvers:
        P = self.hessian(omega_scale)
        minimiser: Array = -np.asarray(np.linalg.inv(P), dtype=np.float64)
        if self._jerk is None:
            return _Solvers(minimiser, QpSolver(P), QpSolver(P, self.G))
        D = self._jerk.D
        return _Solvers(minimiser, QpSolver(P, D), QpSolver(P, np.vstack([self.G, D])))


_NO_JERK = np.zeros(3)
_NO_JERK.flags.writeable = False
"""Value of the bounds on jerk if jerk is not bounded."""
_ALL = 0b111
"""Bits of the three axes."""


def _axes(kept: int) -> list[int]:
    """Return the axes whose bit in ``kept`` is not set."""
    return [axis for axis in range(3) if not kept >> axis & 1]


def _as_bits(kept: NDArray[np.bool_]) -> int:
    """Return the bits of the axes that are true in all of ``kept`` (n, 3)."""
    return sum(1 << axis for axis in range(3) if kept[:, axis].all())


@kernel(
    VOID,
    *[array(1)] * 2,
    array(2),
    *[array(1)] * 3,
    *[FLOAT] * 2,
    *[array(2)] * 3,
    *[output(2)] * 6,
)
def _vectors(
    x: Array,
    v: Array,
    f: Array,
    destination: Array,
    velocity: Array,
    u_max: Array,
    a_total: float,
    dt: float,
    pull: Array,
    lowest: Array,
    highest: Array,
    c: Array,
    x_l: Array,
    x_u: Array,
    h_l: Array,
    h_u: Array,
    far: Array,
) -> None:
    """Write the vectors of ``Problem``: c of eq. (2), the bounds of a, (5), and of the states, (6) and (7).

    ``pull`` (2, n) times the errors of position and velocity at the end is c; ``lowest`` and ``highest``
    (3, 2n) are the limits of velocities and positions.
    """
    n = len(f)
    if len(x) != 3 or len(v) != 3 or len(destination) != 3 or len(velocity) != 3 or c.shape[1] != n:
        raise ValueError("x, v, destination and velocity have 3 entries, f one row per step")
    reach = np.empty(3)
    for k in range(n):
        square = 0.0
        for i in range(3):
            reach[i] = abs(f[k, i]) + u_max[i]
            square += reach[i] * reach[i]
        # The box of the inputs is shrunk until its far corner lies in the ball ‖a‖ ≤ a_total.
        scale = min(1.0, a_total / sqrt(square))
        for i in range(3):
            far[i, k] = reach[i] * scale
            x_l[i, k] = max(f[k, i] - u_max[i], -far[i, k])
            x_u[i, k] = min(f[k, i] + u_max[i], far[i, k])
    for i in range(3):
        off_x, off_v = x[i] + n * dt * v[i] - destination[i], v[i] - velocity[i]
        for k in range(n):
            c[i, k] = off_x * pull[0, k] + off_v * pull[1, k]
            drifted = x[i] + dt * (k + 1) * v[i]
            h_l[i, k], h_u[i, k] = lowest[i, k] - v[i], highest[i, k] - v[i]
            h_l[i, n + k], h_u[i, n + k] = lowest[i, n + k] - drifted, highest[i, n + k] - drifted


@kernel(INT, array(2), *[array(2)] * 3, output(2))
def _free_minimiser(minimiser: Array, c: Array, x_l: Array, x_u: Array, a: Array) -> int:
    """Write −P⁻¹c of each axis to ``a`` (n, 3); return the bits of the axes on which it keeps its bounds.

    A NaN anywhere fails the comparisons, and reaches a solver that refuses it.
    """
    n, inside = len(a), 0
    for i in range(3):
        keeps = True
        for k in range(n):
            value = 0.0
            for m in range(n):
                value += minimiser[k, m] * c[i, m]
            a[k, i] = value
            keeps = keeps and value >= x_l[i, k] and value <= x_u[i, k]
        inside |= keeps << i
    return inside


@kernel(INT, array(2), FLOAT, array(2), array(2))
def _kept(a: Array, dt: float, h_l: Array, h_u: Array) -> int:
    """Return the bits of the axes whose states, with accelerations ``a`` (n, 3), keep their limits."""
    n, kept = len(a), 0
    for i in range(3):
        x = v = 0.0
        keeps = True
        for k in range(n):
            x += dt * (v + 0.5 * dt * a[k, i])
            v += dt * a[k, i]
            keeps = keeps and v >= h_l[i, k] - _TOLERANCE and v <= h_u[i, k] + _TOLERANCE
            keeps = keeps and x >= h_l[i, n + k] - _TOLERANCE and x <= h_u[i, n + k] + _TOLERANCE
        kept |= keeps << i
    return kept


@kernel(VOID, array(2), array(2), output(2))
def _clip(x_l: Array, x_u: Array, a: Array) -> None:
    """Clip ``a`` (n, 3) to its bounds (3, n)."""
    for k in range(len(a)):
        for i in range(3):
            a[k, i] = min(max(a[k, i], x_l[i, k]), x_u[i, k])


@kernel(VOID, *[array(1)] * 5, *[FLOAT] * 3, output(1))
def _gradient(
    last: Array,
    x_end: Array,
    v_end: Array,
    destination: Array,
    velocity: Array,
    dt: float,
    ratio_i: float,
    ratio_v: float,
    gradient: Array,
) -> None:
    """Write ∇J, eq. (11), divided by Ω_t, to ``gradient`` (3,); ``last`` (3,) is a(N).

    ``ratio_i`` and ``ratio_v`` are Ω_i and the Ω_t of the velocity, divided by the Ω_t of the position.
    """
    for i in range(3):
        e_x, e_v = x_end[i] - destination[i], v_end[i] - velocity[i]
        gradient[i] = 2.0 * (e_x + ratio_i * last[i] + 0.5 * dt * dt * e_x + ratio_v * dt * e_v)


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
    jerk: float,
    dt: float,
    step: float,
    last: float,
    found: Array,
) -> None:
    """Write to ``found`` (n,) accelerations as ``pushed`` (n,) until speed or braking distance allow no more.

    They point towards a side that is ``room`` m away, approached at ``v`` m/s; ``fastest`` is the largest
    speed, m/s. Without a bound on ``jerk``, which is then 0, they are not less than ``least`` (n,). With one
    they continue the acceleration ``last`` within it; ``step`` (s) is the time for the first change.
    """
    n = len(pushed)
    place = room - _INSIDE
    strong = -_SPARE * min(least[n - 1], 0.0)
    lost = dt if jerk == 0.0 else dt + strong / (2.0 * jerk)
    for k in range(n):
        stop = sqrt(2.0 * strong * max(place - lost * max(v, 0.0), 0.0))
        rest = min(fastest, stop) - v
        # A vehicle that moves away from that side too fast must be slowed down first.
        a = max(pushed[k], (-fastest - v) / dt)
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


@kernel(VOID, *[array(2)] * 5, array(1), *[FLOAT] * 2, array(1), *[output(2)] * 4)
def _open(
    reach_l: Array,
    reach_u: Array,
    far: Array,
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
    """Open the bounds of ``Problem`` in place as ``Dqmpc.reachable`` describes.

    ``reach_l``, ``reach_u`` (3, n): accelerations that a bound on jerk allows; without one ``j_max`` (3,) is
    0. ``lowest``, ``highest`` (3, 2n): limits of velocities and positions. ``flown`` (3,): the acceleration
    that the plan continues, with ``step`` (s) for its first change.
    """
    n = far.shape[1]
    low, high, least, most = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    rows, gain, margin, late = np.empty(2 * n), np.empty(2 * n), np.empty(2 * n), np.empty(n)
    for i in range(3):
        for k in range(n):
            low[k] = min(max(x_l[i, k], reach_l[i, k]), reach_u[i, k])
            high[k] = max(min(x_u[i, k], reach_u[i, k]), reach_l[i, k])
            least[k] = min(min(max(-far[i, k], reach_l[i, k]), reach_u[i, k]), low[k])
            most[k] = max(max(min(far[i, k], reach_u[i, k]), reach_l[i, k]), high[k])
        # The state that the plan begins with, recovered from the drift in the rows.
        v = lowest[i, 0] - h_l[i, 0]
        x = lowest[i, 2 * n - 1] - h_l[i, 2 * n - 1] - n * dt * v
        fastest = highest[i, 0] - _SLOWER
        _rows_of(high, dt, rows)
        if (h_l[i] > rows + _TOLERANCE).any():
            _late(-high, -most, x - lowest[i, 2 * n - 1], -v, fastest, j_max[i], dt, step, -flown[i], late)
            for k in range(n):
                high[k] = max(high[k], -late[k])
        _rows_of(low, dt, rows)
        if (rows > h_u[i] + _TOLERANCE).any():
            _late(low, least, highest[i, 2 * n - 1] - x, v, fastest, j_max[i], dt, step, flown[i], late)
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
