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

from companion.avoidance.reduced_qp import ReducedQp, Vectors
from companion.config.planning import HeadingConfig, HorizonConfig
from companion.errors import SolverError
from companion.values.compiled import FLOAT, VOID, array, kernel, output
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
        self._S_v, self._S_x, _ = prediction(n, dt)
        P: Array = 2.0 * (self._S_x.T @ self._S_x + config.effort * np.eye(n))
        self._qp = ReducedQp(P, self._S_v, 1)
        self._highest: Array = np.full((1, n), config.acceleration_max)
        self._lowest: Array = -self._highest
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
        vectors = np.empty((3, 1, self._n))
        _yaw_vectors(
            state.yaw,
            state.rate,
            np.ascontiguousarray(positions),
            np.ascontiguousarray(targets),
            self._config.blind,
            self._config.rate_max,
            self._dt,
            self._S_x,
            vectors,
        )
        c, slowest, fastest = vectors
        try:
            solved = self._qp.solve(Vectors(c, self._lowest, self._highest, slowest, fastest))
        except SolverError:
            return
        self._accelerations = solved[0]
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


@kernel(VOID, *[FLOAT] * 2, *[array(2)] * 2, *[FLOAT] * 3, array(2), output(3))
def _yaw_vectors(
    yaw: float,
    rate: float,
    positions: Array,
    targets: Array,
    blind: float,
    rate_max: float,
    dt: float,
    S_x: Array,
    vectors: Array,
) -> None:
    """Write ``vectors`` (3, 1, n) of the QP: c, and the bounds of the change of the rate in each step.

    The bearings of the ``targets`` from the ``positions`` have no jumps of 2π, and begin with the turn
    nearest to ``yaw``.
    """
    c, n = vectors[0, 0], S_x.shape[0]
    # A present rate above the bound must be allowed, otherwise there is no solution.
    fastest = max(rate_max, abs(rate))
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
        vectors[1, 0, k], vectors[2, 0, k] = -fastest - rate, fastest - rate
