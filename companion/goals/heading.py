"""Yaw that faces the target, planned over the horizon like a fourth axis.

The paper sends the bearing of the target (Algorithm 1, line 4). Close to the target that bearing turns faster
than a multirotor can: its yaw torque is weak. As the path is planned, the yaw starts to turn beforehand: the
QP keeps the yaw nearest to the bearings ahead, in the sense of least squares, within the vehicle's yaw rate
and acceleration.
"""

from __future__ import annotations

from math import atan2, pi
from typing import NamedTuple

import numpy as np

from companion.avoidance.solver import QpSolver
from companion.config.planning import HeadingConfig, HorizonConfig
from companion.errors import SolverError
from companion.values.compiled import FLOAT, array, kernel, output
from companion.values.horizon import Array
from companion.values.prediction import prediction

_STRIDE = 2
"""Number of the path's steps in one step of the yaw plan."""


class Yaw(NamedTuple):
    """ENU yaw (rad, not wrapped), its rate (rad/s) and acceleration (rad/s²)."""

    yaw: float
    rate: float
    acceleration: float


class Heading:
    """Yaw planner of one vehicle; each plan starts from the state of the last one."""

    def __init__(self, config: HeadingConfig, horizon: HorizonConfig) -> None:
        # Yaw is slow: longer steps than the path's suffice.
        n, dt = (horizon.steps + 1) // _STRIDE, _STRIDE * horizon.dt_us * 1e-6
        self._config, self._dt, self._n = config, dt, n
        self._S_v, self._S_x, self._ahead = prediction(n, dt)
        P: Array = 2.0 * (self._S_x.T @ self._S_x + config.effort * np.eye(n))
        self._minimiser: Array = -np.asarray(np.linalg.inv(P), dtype=np.float64)
        self._bounded, self._limited = QpSolver(P), QpSolver(P, self._S_v)
        self._limit: Array = np.full(n, config.acceleration_max)
        self._max_rate_change = config.acceleration_max * float(self._ahead[-1])
        self._start: int | None = None
        self._state = Yaw(0.0, 0.0, 0.0)
        self._accelerations: Array = np.zeros(n)

    def reset(self, measured: float) -> None:
        """Discard the plan and keep the ``measured`` yaw (rad, ENU)."""
        self._start = None
        self._state = Yaw(measured, 0.0, 0.0)

    def plan(self, now: int, positions: Array, targets: Array) -> None:
        """Plan from ``now`` (µs) along the own ``positions`` (N + 1, 3), facing ``targets`` (N + 1, 3), m.

        Both are given at n = 1…N + 1. If the QP has no solution, the last yaw plan is kept.
        """
        state = self.at(now)
        c, free = np.empty(self._n), np.empty(self._n)
        largest = _yaw_vectors(
            state.yaw,
            state.rate,
            np.ascontiguousarray(positions),
            np.ascontiguousarray(targets),
            self._config.blind,
            self._dt,
            self._S_x,
            self._minimiser,
            c,
            free,
        )
        try:
            self._accelerations = self._solve(c, free, largest, state.rate)
        except SolverError:
            return
        self._start, self._state = now, state

    def at(self, time: int) -> Yaw:
        """Return the planned yaw at ``time`` (µs); it is constant after the horizon."""
        if self._start is None:
            return self._state
        elapsed = max(time - self._start, 0) * 1e-6
        index = min(int(elapsed / self._dt), self._n)
        a = self._accelerations
        rate, yaw = self._state.rate, self._state.yaw
        if index:
            yaw += index * self._dt * rate + float(self._S_x[index - 1] @ a)
            rate += float(self._S_v[index - 1] @ a)
        if index == self._n:
            return Yaw(yaw, 0.0, 0.0)
        s = elapsed - index * self._dt
        acceleration = float(a[index])
        return Yaw(yaw + s * rate + 0.5 * s * s * acceleration, rate + s * acceleration, acceleration)

    def _solve(self, c: Array, free: Array, largest: float, rate: float) -> Array:
        """Return the ``free`` minimiser (n,) where it surely keeps all bounds, else PIQP's solution.

        ``largest`` is its largest absolute acceleration, rad/s².
        """
        limit, bound = self._limit, self._config.rate_max
        if largest <= limit[0] and abs(rate) + largest * float(self._ahead[-1]) <= bound:
            return free
        if abs(rate) + self._max_rate_change <= bound:
            return self._bounded.solve(c, -limit, limit)
        # A present rate above the bound must be allowed, otherwise there is no solution.
        rows = np.full(self._n, max(bound, abs(rate)))
        return self._limited.solve(c, -limit, limit, -rows - rate, rows - rate)


@kernel(FLOAT, FLOAT, FLOAT, array(2), array(2), FLOAT, FLOAT, array(2), array(2), output(1), output(1))
def _yaw_vectors(
    yaw: float,
    rate: float,
    positions: Array,
    targets: Array,
    blind: float,
    dt: float,
    S_x: Array,
    minimiser: Array,
    c: Array,
    free: Array,
) -> float:
    """Write c (n,) of the QP and its free minimiser (n,), −P⁻¹c; return the largest absolute entry of that.

    The bearings of the ``targets`` from the ``positions`` have no jumps of 2π, and begin with the turn
    nearest to ``yaw``.
    """
    n = len(c)
    missing = np.empty(n)
    before = wanted = yaw
    for k in range(n):
        row = _STRIDE * (k + 1) - 1
        east, north = targets[row, 0] - positions[row, 0], targets[row, 1] - positions[row, 1]
        # Straight above or below the target its bearing is undefined: the present yaw takes its place.
        bearing = yaw if max(abs(east), abs(north)) < blind else atan2(north, east)
        step = bearing - before
        before = bearing
        wanted += step - 2.0 * pi * np.round(step * (0.5 / pi))
        missing[k] = 2.0 * (yaw + (k + 1) * dt * rate - wanted)
    for k in range(n):
        c[k] = 0.0
        for row in range(n):
            c[k] += S_x[row, k] * missing[row]
    largest = 0.0
    for k in range(n):
        free[k] = 0.0
        for m in range(n):
            free[k] += minimiser[k, m] * c[m]
        if not abs(free[k]) <= largest:
            largest = abs(free[k])
    return largest
