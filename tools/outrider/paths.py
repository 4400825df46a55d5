"""Smooth closed paths through given places, flown along at a constant speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_FINE = 4096
"""Pieces that the path is measured in."""


class Motion(NamedTuple):
    """Position (3,) m and velocity (3,) m/s, fleet-local ENU."""

    position: Array
    velocity: Array


class ClosedPath:
    """The trigonometric polynomial through ``places`` (n, 3) at even parameters: smooth everywhere, and
    closed. ``length`` in m."""

    def __init__(self, places: Array) -> None:
        count = len(places)
        self._harmonics = np.fft.fftfreq(count, 1.0 / count)
        self._coefficients = np.fft.fft(places, axis=0) / count
        if count % 2 == 0:
            # The highest harmonic of an even number is a cosine; as one complex term it would not be real.
            half = count // 2
            self._harmonics = np.append(self._harmonics, half)
            self._coefficients[half] *= 0.5
            self._coefficients = np.vstack([self._coefficients, np.conj(self._coefficients[half])])
        self._parameters = np.linspace(0.0, 2.0 * np.pi, _FINE + 1)
        steps = np.linalg.norm(np.diff(self._at(self._parameters, 0), axis=0), axis=1)
        self._lengths = np.concatenate([[0.0], np.cumsum(steps)])
        self.length = float(self._lengths[-1])

    def at(self, distance: float, speed: float) -> Motion:
        """After ``distance`` m along it (round and round), at ``speed`` m/s."""
        parameter = np.interp(distance % self.length, self._lengths, self._parameters)
        along = self._at(np.array([parameter]), 1)[0]
        return Motion(self._at(np.array([parameter]), 0)[0], speed * along / np.linalg.norm(along))

    @property
    def sharpest(self) -> float:
        """The largest curvature, 1/m: at v m/s it takes v² times that in m/s²."""
        first, second = self._at(self._parameters, 1), self._at(self._parameters, 2)
        bent = np.linalg.norm(np.cross(first, second), axis=1) / np.linalg.norm(first, axis=1) ** 3
        return float(bent.max())

    def _at(self, parameters: Array, derivative: int) -> Array:
        """The polynomial or a derivative of it, (n, 3)."""
        turning = (1j * self._harmonics) ** derivative * np.exp(1j * np.outer(parameters, self._harmonics))
        result: Array = np.real(turning @ self._coefficients)
        return result
