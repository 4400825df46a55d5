"""Trajectory on equidistant knots with piecewise constant acceleration: a plan, own or a neighbour's.

Time is integer µs on the companion's clock; positions are fleet-local ENU, m. Before the first knot and after
the last one the velocity is constant, so that a horizon of 1.6 s that is 0.1 s old still covers 1.6 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.values.compiled import BOOL, FLOAT, INT, VOID, array, kernel, output, part
from companion.values.knot_store import STORE

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
        found = np.empty((3, 3))
        _state(self.knots, time - self.epoch, self.dt, found)
        return Motion(found[0], found[1], found[2])

    def positions(self, start: int, steps: int, dt: int) -> Array:
        """Return positions (steps, 3), m, at ``start + n·dt`` (µs), n = 0…steps − 1."""
        found = np.empty((steps, 3))
        _positions(self.knots, start - self.epoch, dt, self.dt, found)
        return found


_NO_PLAN_US = 1 << 62


def roll_out(epoch: int, dt: int, position: Array, velocity: Array, accelerations: Array) -> Horizon:
    """Return the horizon from a state and accelerations (n, 3): the A and B of the paper, eq. (8)."""
    knots = np.empty((len(accelerations) + 1, 9))
    _roll_out(dt * 1e-6, position, velocity, np.ascontiguousarray(accelerations), knots)
    return Horizon(epoch, dt, knots)


@kernel(VOID, FLOAT, array(1), array(1), array(2), output(2))
def _roll_out(dt: float, position: Array, velocity: Array, accelerations: Array, knots: Array) -> None:
    """Write the knots (n + 1, 9) of the double integrator, eq. (8), with steps of ``dt`` (s)."""
    n = len(accelerations)
    for i in range(3):
        x, v = position[i], velocity[i]
        for k in range(n):
            a = accelerations[k, i]
            knots[k, i], knots[k, 3 + i], knots[k, 6 + i] = x, v, a
            x += dt * (v + 0.5 * dt * a)
            v += dt * a
        knots[n, i], knots[n, 3 + i], knots[n, 6 + i] = x, v, 0.0


@part
def _positions_of(knots: Array, last: int, elapsed: int, step: int, dt: int, found: Array) -> None:
    """Write the positions (m, 3) of knots 0…``last``, ``dt`` (µs) apart.

    They are those at ``elapsed`` (µs) after the first knot and every ``step`` (µs) from then on.
    """
    for n in range(len(found)):
        time = elapsed + n * step
        k = min(max(time // dt, 0), last)
        s = (time - k * dt) * 1e-6
        # Before its first knot a horizon has no acceleration.
        half = 0.5 * max(s, 0.0)
        for i in range(3):
            found[n, i] = knots[k, i] + s * (knots[k, 3 + i] + half * knots[k, 6 + i])


@kernel(VOID, array(2), INT, INT, output(2))
def _state(knots: Array, elapsed: int, dt: int, found: Array) -> None:
    """Write position, velocity and acceleration (3, 3) at ``elapsed`` (µs) after the first of the knots."""
    k = min(max(elapsed // dt, 0), len(knots) - 1)
    s = (elapsed - k * dt) * 1e-6
    for i in range(3):
        # Before its first knot a horizon has no acceleration.
        a = knots[k, 6 + i] if s >= 0.0 else 0.0
        found[0, i] = knots[k, i] + s * (knots[k, 3 + i] + (0.5 * s) * a)
        found[1, i] = knots[k, 3 + i] + s * a
        found[2, i] = a


@kernel(VOID, array(2), INT, INT, INT, output(2))
def _positions(knots: Array, elapsed: int, step: int, dt: int, found: Array) -> None:
    """Write the positions ``found`` of a whole horizon, see ``_positions_of``."""
    _positions_of(knots, len(knots) - 1, elapsed, step, dt, found)


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
        # Epoch (µs), dt (µs), index of the last knot, and row in the store, of each horizon.
        self._heads = np.zeros((0, 4), dtype=np.int64)
        self._latest: dict[int, Horizon] = {}
        # The last answer of ``_rows_of``: the same senders, in the same tuple, are asked for again and again.
        self._asked: Sequence[int] = ()
        self._rows_when_asked = -1
        self._answer = np.zeros(0, dtype=np.int64)
        self._fresh: set[int] = set()

    def put(self, sender: int, horizon: Horizon) -> None:
        """Store ``horizon`` unless one of the same sender with a later epoch is known."""
        last = self._latest.get(sender)
        if last is None or horizon.epoch >= last.epoch:
            self._latest[sender] = horizon
            self._fresh.add(sender)

    def _update_rows(self) -> None:
        """Write the heads of the horizons stored since the last call."""
        new = len(self._latest) - len(self._rows)
        if new:
            self._rows = {sender: row for row, sender in enumerate(self._latest)}
            self._heads = np.concatenate([self._heads, np.zeros((new, 4), dtype=np.int64)])
        horizons = [self._latest[sender] for sender in self._fresh]
        self._heads[[self._rows[sender] for sender in self._fresh]] = [
            (epoch, dt, len(knots) - 1, STORE.row_of(knots)) for epoch, dt, knots in horizons
        ]
        self._fresh.clear()

    def positions(self, senders: Sequence[int], start: int, oldest: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return positions (M, steps, 3), m, of ``senders`` at ``start + n·dt``, and a mask (M,).

        The mask is true for horizons whose epoch is ``oldest`` (µs) or later; the other rows are undefined.
        """
        rows = self._rows_of(senders)
        known = np.empty(len(senders), dtype=np.bool_)
        positions = np.empty((len(senders), self._steps, 3))
        self._sample(rows, np.array([start]), oldest, positions, known)
        return positions, known

    def at(self, senders: Sequence[int], times: NDArray[np.int64]) -> Located:
        """Return the planned position of each of ``senders`` (M,) at the corresponding ``times`` (M,), µs."""
        rows = self._rows_of(senders)
        if not self._rows:
            none = np.full(len(senders), _NO_PLAN_US)
            return Located(np.zeros((len(senders), 3)), none, np.zeros_like(none))
        positions, known = np.zeros((len(senders), 1, 3)), np.zeros(len(senders), dtype=np.bool_)
        self._sample(rows, times, -_NO_PLAN_US, positions, known)
        heads = self._heads[rows]
        after = np.where(known, times - heads[:, 0], _NO_PLAN_US)
        return Located(positions[:, 0], after, heads[:, 1])

    def starts(self, senders: Sequence[int]) -> tuple[NDArray[np.int64], Array]:
        """Return when (M,), µs, the horizons of ``senders`` begin, and their first states (M, 6).

        The time is far in the past for those without a horizon, and the state zero.
        """
        rows = self._rows_of(senders)
        if not self._rows:
            return np.full(len(senders), -_NO_PLAN_US), np.zeros((len(senders), 6))
        known, heads = rows >= 0, self._heads[rows]
        states = np.where(known[:, None], STORE.knots[heads[:, 3], 0, 0:6], 0.0)
        return np.where(known, heads[:, 0], -_NO_PLAN_US), states

    def accelerations(self, senders: Sequence[int], times: NDArray[np.int64]) -> Array:
        """Return the planned accelerations (M, 3), m/s², of ``senders`` (M,).

        They are those at the corresponding ``times`` (M,), µs. Each is zero after the plan and without a
        plan. Before the plan it is that of the plan's first segment: the measured state that comes with a
        plan may be dated slightly earlier.
        """
        rows = self._rows_of(senders)
        if not self._rows:
            return np.zeros((len(senders), 3))
        epochs, dts, lasts, stored = self._heads[rows].T
        segments = np.clip((times - epochs) // dts, 0, lasts)
        planned: Array = STORE.knots[stored, segments, 6:9]
        return np.where((rows >= 0)[:, None], planned, 0.0)

    def _rows_of(self, senders: Sequence[int]) -> NDArray[np.int64]:
        """Return the row of each sender (M,); −1 for those without a horizon."""
        if self._fresh:
            self._update_rows()
        same = senders is self._asked and isinstance(senders, tuple)
        if not same or len(self._rows) != self._rows_when_asked:
            self._answer = np.array([self._rows.get(sender, -1) for sender in senders], dtype=np.int64)
            self._asked, self._rows_when_asked = senders, len(self._rows)
        return self._answer

    def _sample(
        self,
        rows: NDArray[np.int64],
        times: NDArray[np.int64],
        oldest: int,
        positions: Array,
        known: NDArray[np.bool_],
    ) -> None:
        """Write positions (M, n, 3), m, of ``rows`` (M,) at ``times`` (M,) or (1,), µs, then one per ``dt``.

        ``known`` (M,) becomes true for horizons whose epoch is ``oldest`` (µs) or later.
        """
        _sample(STORE.knots, self._heads, rows, times, self._dt, oldest, positions, known)


@kernel(VOID, array(3), array(2, INT), *[array(1, INT)] * 2, INT, INT, output(3), output(1, BOOL))
def _sample(
    knots: Array,
    heads: NDArray[np.int64],
    rows: NDArray[np.int64],
    times: NDArray[np.int64],
    step: int,
    oldest: int,
    positions: Array,
    known: NDArray[np.bool_],
) -> None:
    """Write ``HorizonTable._sample``.

    ``heads`` (H, 4): epoch, dt (µs), index of the last knot and row in ``knots`` (S, k, 9) of each horizon.
    ``step`` (µs) is the time between two of the positions (M, n, 3).
    """
    for j in range(len(rows)):
        row = rows[j]
        known[j] = row >= 0 and heads[row, 0] >= oldest
        if row >= 0:
            elapsed = times[j % len(times)] - heads[row, 0]
            _positions_of(knots[heads[row, 3]], heads[row, 2], elapsed, step, heads[row, 1], positions[j])
        else:
            positions[j] = 0.0
