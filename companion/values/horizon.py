"""Trajectory on equidistant knots with piecewise constant acceleration: a plan, own or a neighbour's.

Time is integer µs on the companion's clock; positions are fleet-local ENU, m. Before the first knot and after
the last one the velocity is constant, so that a horizon of 1.6 s that is 0.1 s old still covers 1.6 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.values.prediction import prediction

Array = NDArray[np.float64]


class Motion(NamedTuple):
    """Position (3,), velocity (3,), acceleration (3,): fleet-local ENU, SI."""

    position: Array
    velocity: Array
    acceleration: Array


class Horizon(NamedTuple):
    """Knots 0…n of a trajectory from ``epoch`` (µs) on, ``dt`` (µs) apart.

    ``knots`` (n + 1, 9): position, velocity, and acceleration of the segment that follows. The acceleration
    of the last knot is zero: beyond the end the velocity is kept.
    """

    epoch: int
    dt: int
    knots: Array

    @property
    def end(self) -> int:
        """Time of the last knot, µs."""
        return self.epoch + self.dt * (len(self.knots) - 1)

    def at(self, time: int) -> Motion:
        """Return the motion at ``time`` (µs): the exact quadratic of the segment, not an interpolation."""
        last = len(self.knots) - 1
        index = min(max((time - self.epoch) // self.dt, 0), last)
        s = (time - self.epoch - index * self.dt) * 1e-6
        knot = self.knots[index]
        p, v, a = knot[0:3], knot[3:6], knot[6:9]
        if s < 0.0:
            a = _ZERO
        return Motion(p + s * (v + (0.5 * s) * a), v + s * a, a)

    def positions(self, start: int, steps: int, dt: int) -> Array:
        """Return positions (steps, 3), m, at ``start + n·dt``, n = 0…steps − 1.

        ``start`` (µs) must not lie before the first knot; ``steps`` is at most 64.
        """
        elapsed = (start - self.epoch) + dt * _COUNT[:steps]
        index = np.minimum(elapsed // self.dt, len(self.knots) - 1)
        s = ((elapsed - index * self.dt) * 1e-6)[:, None]
        chosen = self.knots[index]
        result: Array = chosen[:, 0:3] + s * (chosen[:, 3:6] + (0.5 * s) * chosen[:, 6:9])
        return result


_ZERO = np.zeros(3)
_ZERO.flags.writeable = False
_COUNT = np.arange(64)
_NO_PLAN_US = 1 << 62


def roll_out(epoch: int, dt: int, position: Array, velocity: Array, accelerations: Array) -> Horizon:
    """Return the horizon from a state and accelerations (n, 3): the A and B of the paper, eq. (8)."""
    n = len(accelerations)
    S_v, S_x, time = prediction(n, dt * 1e-6)
    knots = np.zeros((n + 1, 9))
    knots[0, 0:3], knots[0, 3:6] = position, velocity
    knots[1:, 0:3] = S_x @ accelerations + position + np.multiply.outer(time, velocity)
    knots[1:, 3:6] = S_v @ accelerations + velocity
    knots[:n, 6:9] = accelerations
    return Horizon(epoch, dt, knots)


class Located(NamedTuple):
    """Positions of M plans, each at a time of its own.

    ``positions`` (M, 3), m. ``after`` (M,): that time minus the plan's epoch, µs. ``dt`` (M,): the plan's
    step, µs. For a sender without a plan, ``after`` is larger than any plan's age and the rest is undefined.
    """

    positions: Array
    after: NDArray[np.int64]
    dt: NDArray[np.int64]


class HorizonTable:
    """Latest horizon of each of many senders, sampled together.

    It gives ``steps`` positions of each sender, ``dt`` (µs) apart, from any time on, or one position of each
    at a time of its own. Horizons are aligned by time, not by index: the paper's implementation shared
    horizons without time stamps and never detected their age.
    """

    def __init__(self, steps: int, dt: int) -> None:
        self._steps = steps
        self._dt = dt
        self._rows: dict[int, int] = {}
        self._epochs = np.zeros(0, dtype=np.int64)
        self._dts = np.zeros(0, dtype=np.int64)
        self._lasts = np.zeros(0, dtype=np.int64)
        self._knots = np.zeros((0, 1, 9))
        self._latest: dict[int, Horizon] = {}
        self._fresh: set[int] = set()
        self._ahead = dt * np.arange(steps)

    def put(self, sender: int, horizon: Horizon) -> None:
        """Store ``horizon`` unless one of the same sender with a later epoch is known."""
        last = self._latest.get(sender)
        if last is None or horizon.epoch >= last.epoch:
            self._latest[sender] = horizon
            self._fresh.add(sender)

    def _update_rows(self) -> None:
        """Write the horizons stored since the last call into the table, row by row."""
        new = [sender for sender in self._fresh if sender not in self._rows]
        if new:
            self._rows.update(zip(new, range(len(self._rows), len(self._latest)), strict=True))
            self._epochs = np.append(self._epochs, [0] * len(new))
            self._dts = np.append(self._dts, [1] * len(new))
            self._lasts = np.append(self._lasts, [0] * len(new))
            self._knots = np.concatenate([self._knots, np.zeros((len(new), *self._knots.shape[1:]))])
        fresh = [self._latest[sender] for sender in self._fresh]
        longest = max(len(horizon.knots) for horizon in fresh)
        if longest > self._knots.shape[1]:
            longer = np.zeros((len(self._rows), longest, 9))
            longer[:, : self._knots.shape[1]] = self._knots
            self._knots = longer
        rows = [self._rows[sender] for sender in self._fresh]
        for row, horizon in zip(rows, fresh, strict=True):
            self._knots[row, : len(horizon.knots)] = horizon.knots
        self._epochs[rows] = [horizon.epoch for horizon in fresh]
        self._dts[rows] = [horizon.dt for horizon in fresh]
        self._lasts[rows] = [len(horizon.knots) - 1 for horizon in fresh]
        self._fresh.clear()

    def positions(self, senders: Sequence[int], start: int, oldest: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return positions (M, steps, 3), m, of ``senders`` at ``start + n·dt``, and a mask (M,).

        The mask is true for horizons whose epoch is ``oldest`` (µs) or later; the other rows are undefined.
        """
        rows = self._rows_of(senders)
        if not self._rows:
            return np.zeros((len(senders), self._steps, 3)), np.zeros(len(senders), dtype=np.bool_)
        epochs = self._epochs[rows]
        known: NDArray[np.bool_] = (rows >= 0) & (epochs >= oldest)
        return self._sampled(rows, (start - epochs)[:, None] + self._ahead), known

    def at(self, senders: Sequence[int], times: NDArray[np.int64]) -> Located:
        """Return the planned position of each of ``senders`` (M,) at the corresponding ``times`` (M,), µs."""
        rows = self._rows_of(senders)
        if not self._rows:
            none = np.full(len(senders), _NO_PLAN_US)
            return Located(np.zeros((len(senders), 3)), none, np.zeros_like(none))
        after = times - self._epochs[rows]
        positions = self._sampled(rows, after[:, None])[:, 0]
        return Located(positions, np.where(rows >= 0, after, _NO_PLAN_US), self._dts[rows])

    def accelerations(self, senders: Sequence[int], times: NDArray[np.int64]) -> Array:
        """Return the planned accelerations (M, 3), m/s², of ``senders`` (M,).

        They are those at the corresponding ``times`` (M,), µs. Each is zero after the plan and without a
        plan. Before the plan it is that of the plan's first segment: the measured state that comes with a
        plan may be dated slightly earlier.
        """
        rows = self._rows_of(senders)
        if not self._rows:
            return np.zeros((len(senders), 3))
        elapsed = times - self._epochs[rows]
        planned: Array = self._knots[rows, self._segments(rows, elapsed[:, None])[:, 0], 6:9]
        return np.where((rows >= 0)[:, None], planned, 0.0)

    def _rows_of(self, senders: Sequence[int]) -> NDArray[np.int64]:
        """Return the row of each sender (M,); −1 for those without a horizon."""
        if self._fresh:
            self._update_rows()
        return np.array([self._rows.get(sender, -1) for sender in senders], dtype=np.int64)

    def _segments(self, rows: NDArray[np.int64], elapsed: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the segments (M, n) at these times; the first one before a plan, the last knot after it."""
        index = elapsed // self._dts[rows][:, None]
        np.maximum(index, 0, out=index)
        np.minimum(index, self._lasts[rows][:, None], out=index)
        return index

    def _sampled(self, rows: NDArray[np.int64], elapsed: NDArray[np.int64]) -> Array:
        """Return positions (M, n, 3), m, of ``rows`` (M,) at ``elapsed`` (M, n), µs, after their epochs."""
        index = self._segments(rows, elapsed)
        s = ((elapsed - index * self._dts[rows][:, None]) * 1e-6)[:, :, None]
        # One index into one long table is twice as fast as two indices.
        count = self._knots.shape[1]
        chosen = self._knots.reshape(-1, 9).take(index + (rows * count)[:, None], axis=0, mode="wrap")
        # Before its first knot a horizon has no acceleration.
        result: Array = chosen[:, :, 6:9] * (0.5 * np.maximum(s, 0.0))
        result += chosen[:, :, 3:6]
        result *= s
        result += chosen[:, :, 0:3]
        return result
