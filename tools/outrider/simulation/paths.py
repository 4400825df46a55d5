"""Smooth closed paths through given places, and motion along a path at given speeds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_PIECES = 4096
"""Number of straight pieces by which the length of a path is measured."""
_MIN_LENGTH_M = 1e-9
"""m; lower bound of lengths, against division by zero if all places are equal."""


class Motion(NamedTuple):
    """Position (3,) m and velocity (3,) m/s, fleet-local ENU."""

    position: Array
    velocity: Array


class ClosedPath:
    """Closed trigonometric polynomial through ``places`` (n, 3), m, at evenly spaced parameters.

    ``length``: length of one round, m.
    """

    def __init__(self, places: Array) -> None:
        count = len(places)
        self._harmonics = np.fft.fftfreq(count, 1.0 / count)
        self._coefficients = np.fft.fft(places, axis=0) / count
        if count % 2 == 0:
            # For an even number of places the highest harmonic must be a cosine: its two conjugate terms.
            half = count // 2
            self._harmonics = np.append(self._harmonics, half)
            self._coefficients[half] *= 0.5
            self._coefficients = np.vstack([self._coefficients, np.conj(self._coefficients[half])])
        self._parameters = np.linspace(0.0, 2.0 * np.pi, _PIECES + 1)
        steps = np.linalg.norm(np.diff(self._at(self._parameters, 0), axis=0), axis=1)
        self._lengths = np.concatenate([[0.0], np.cumsum(steps)])
        self.length = float(self._lengths[-1])

    def at(self, distance: float, speed: float) -> Motion:
        """Return the motion at ``distance`` m along the path, modulo ``length``, at ``speed`` m/s."""
        parameter = self._parameter(np.array([distance]))
        along = self._at(parameter, 1)[0]
        # Where a path along a straight line turns back, its derivative is zero.
        length = max(float(np.linalg.norm(along)), _MIN_LENGTH_M)
        return Motion(self._at(parameter, 0)[0], speed * along / length)

    def places(self, distances: Array) -> Array:
        """Return the positions (n, 3) m after ``distances`` (n,) m."""
        return self._at(self._parameter(distances), 0)

    def _parameter(self, distances: Array) -> Array:
        within = distances % max(self.length, _MIN_LENGTH_M)
        return np.asarray(np.interp(within, self._lengths, self._parameters))

    @property
    def sharpest(self) -> float:
        """Largest curvature κ (1/m): the path at speed v requires a lateral acceleration of up to v²κ."""
        first, second = self._at(self._parameters, 1), self._at(self._parameters, 2)
        bent = np.linalg.norm(np.cross(first, second), axis=1) / np.linalg.norm(first, axis=1) ** 3
        return float(bent.max())

    def _at(self, parameters: Array, derivative: int) -> Array:
        """Return the polynomial or a derivative of it, (n, 3)."""
        turning = (1j * self._harmonics) ** derivative * np.exp(1j * np.outer(parameters, self._harmonics))
        result: Array = np.real(turning @ self._coefficients)
        return result


class Walk:
    """Motion along ``path``; times are µs.

    It rests at the path's beginning until ``begin``, then accelerates with ``setting_out`` m/s² to ``speed``
    m/s and continues round after round. ``paces``: later speeds as (time since the start (s), speed (m/s)),
    reached with the same acceleration.
    """

    def __init__(
        self, path: ClosedPath, speed: float, setting_out: float, paces: Sequence[tuple[float, float]] = ()
    ) -> None:
        self.path = path
        self._speed, self._setting_out = speed, setting_out
        self._profile = _profile([(0.0, speed), *paces], setting_out) if paces else None
        self._start: int | None = None

    def begin(self, now: int) -> None:
        """Start at ``now``."""
        self._start = now

    def motion(self, now: int) -> Motion:
        """Return the position and velocity at ``now``."""
        (distance,), (speed,) = self._gone(np.array([now]))
        return self.path.at(distance, speed)

    def places(self, times: NDArray[np.int64]) -> Array:
        """Return the positions (n, 3) at ``times`` (n,)."""
        return self.path.places(self._gone(times)[0])

    def _gone(self, times: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return the distance covered (n,), m, and the speed (n,), m/s."""
        since = np.zeros(len(times)) if self._start is None else np.maximum(times - self._start, 0) * 1e-6
        if self._profile is not None:
            begins, gone, speeds, gains = self._profile
            part = np.searchsorted(begins, since, side="right") - 1
            spent = since - begins[part]
            reached = speeds[part] + gains[part] * spent
            return gone[part] + 0.5 * (speeds[part] + reached) * spent, reached
        ramp = self._speed / self._setting_out
        speed = self._setting_out * np.minimum(since, ramp)
        return 0.5 * speed * np.minimum(since, ramp) + self._speed * np.maximum(since - ramp, 0.0), speed


def _profile(paces: Sequence[tuple[float, float]], gain: float) -> tuple[Array, Array, Array, Array]:
    """Return pieces of constant acceleration, each (n,).

    For each piece: its beginning (s), the distance covered (m) and the speed (m/s) at its beginning, and its
    acceleration (m/s²). If a pace ends before its speed is reached, the next one starts from the speed
    reached.
    """
    pieces = [(0.0, 0.0, 0.0)]
    speed = 0.0
    for index, (begin, wanted) in enumerate(paces):
        ends = paces[index + 1][0] if index + 1 < len(paces) else np.inf
        change = gain if wanted > speed else -gain
        reached = begin + abs(wanted - speed) / gain
        pieces.append((begin, speed, change if reached > begin else 0.0))
        speed += change * (min(reached, ends) - begin)
        if reached < ends:
            speed = wanted
            pieces.append((reached, speed, 0.0))
    begins, speeds, gains = (np.array(column) for column in zip(*pieces, strict=True))
    spent = np.diff(begins)
    gone = np.concatenate([[0.0], np.cumsum(speeds[:-1] * spent + 0.5 * gains[:-1] * spent**2)])
    return begins, gone, speeds, gains
