"""The yaw that faces the target, planned over the horizon like a fourth axis.

The paper sends the bearing of the target (Algorithm 1, line 4). Close by, that bearing turns faster than a
multirotor can: its yaw torque is weak. Knowing the planned path, the yaw starts to turn beforehand: the QP
keeps the yaw nearest to the bearings ahead, in the sense of least squares, within the vehicle's yaw rate and
acceleration.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.config import HeadingConfig, HorizonConfig
from companion.errors import SolverError
from companion.horizon import Array
from companion.prediction import prediction
from companion.solver import QpSolver


class Yaw(NamedTuple):
    """ENU yaw (rad, not wrapped), its rate (rad/s) and acceleration (rad/s²)."""

    yaw: float
    rate: float
    acceleration: float


class Heading:
    """Plans the yaw of one vehicle; each plan starts from the last one's state."""

    def __init__(self, config: HeadingConfig, horizon: HorizonConfig) -> None:
        n, dt = horizon.steps + 1, horizon.dt_us * 1e-6
        self._config, self._dt, self._n = config, dt, n
        self._S_v, self._S_x, self._ahead = prediction(n, dt)
        P: Array = 2.0 * (self._S_x.T @ self._S_x + config.effort * np.eye(n))
        self._solver = QpSolver(P, self._S_v)
        self._start: int | None = None
        self._state = Yaw(0.0, 0.0, 0.0)
        self._accelerations: Array = np.zeros(n)

    def reset(self, measured: float) -> None:
        """Forget the plan and stand at the ``measured`` yaw."""
        self._start = None
        self._state = Yaw(measured, 0.0, 0.0)

    def plan(self, now: int, positions: Array, targets: Array) -> None:
        """Plan from ``now`` (µs) along own ``positions`` (N + 1, 3) at n = 1…N + 1 facing ``targets`` (N + 1,
        3).

        Without a solution the yaw planned before is kept.
        """
        state = self.at(now)
        offset = targets - positions
        flat = offset[:, 0] ** 2 + offset[:, 1] ** 2
        bearings = np.arctan2(offset[:, 1], offset[:, 0])
        if flat.min() < self._config.blind**2:
            # Above or below the target no bearing is better than another.
            bearings = np.where(flat < self._config.blind**2, state.yaw, bearings)
        # The nearest turn of the first bearing, then without jumps of 2π.
        bearings = np.unwrap(np.concatenate([[state.yaw], bearings]))[1:]
        free = state.yaw + self._ahead * state.rate
        c = 2.0 * (self._S_x.T @ (free - bearings))
        limit = np.full(self._n, self._config.acceleration_max)
        slack = max(self._config.rate_max, abs(state.rate))
        try:
            self._accelerations = self._solver.solve(
                c,
                -limit,
                limit,
                np.full(self._n, -slack - state.rate),
                np.full(self._n, slack - state.rate),
            )
        except SolverError:
            return
        self._start, self._state = now, state

    def at(self, time: int) -> Yaw:
        """The planned yaw at ``time`` (µs); after the horizon it stands."""
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
