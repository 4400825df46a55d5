"""Bearings from a target that make the fused position of the target most certain.

Camera k sees the target from the bearing θ_k (from the target, seen from above) with σ_r along the ray and
σ_t across it. Its information in the plane is a_k I − w_k [cos 2θ_k, sin 2θ_k; sin 2θ_k, −cos 2θ_k] with
a_k = ½(1/σ_r² + 1/σ_t²) and the weight w_k = ½(1/σ_t² − 1/σ_r²). With a = Σ a_k and
s = s₀ + Σ w_k e^{2iθ_k} the fused covariance has the eigenvalues 1/(a ± |s|): its trace 2a/(a² − |s|²) and
its determinant 1/(a² − |s|²) are least where |s| is least. s₀ is the part of an earlier estimate.

Descent of J = ½|s|² is τ_k = 2 w_k (Σ_j w_j sin 2(θ_k − θ_j) + |s₀| sin(2θ_k − arg s₀)). It is divided by
w_k Σ w, which keeps it a descent and makes it independent of the number and the accuracy of the cameras. For
three cameras and more a second descent, of ½|Σ e^{iθ_j}|², leads all around the target, and bearings nearer
to each other than an angle part. Only the part of both that does not change s to first order is used: added
in full, the former ends in states with |s|/Σw = 0.11 (three cameras on one side; |s| could be 0).

A camera contributes the same from the opposite bearing. One that has another in its way for long, and cannot
part from it without a loss, goes there (``Crossing``).
"""

from __future__ import annotations

from math import pi, radians

import numpy as np

from companion.values.bearings import wrapped
from companion.values.horizon import Array

_MIN_DISTANCE_M = 0.5
"""Distance below which a camera's accuracy is that at this distance."""
_MIN_SHARE = 0.1
"""Least weight, as a share of the mean, by which the part all around is divided."""
_DAMPING = 1e-3
"""Regularisation of the projection; the matrix is singular where all bearings are on one line."""
_SADDLE = 0.9
"""A bearing is at a saddle if Re(s̄ e^{2iθ_k}) exceeds this share of w_k.

The second derivative of ½|s|² by θ_k is 4 w_k (w_k − Re(s̄ e^{2iθ_k})).
"""
_PARTING = 0.3
"""Turn (rad, before the projection) of two cameras at one bearing away from each other."""
_CROWDED_US, _CROWDED = 3_000_000, 0.8
"""A camera crosses that has been nearer to another than this share of the angle apart for this time (µs)."""
_BEYOND, _LONGEST = 0.25 * pi, 1.25 * pi
"""A camera crosses by the first angle (rad) at least, until its descent leads on; by the second at most."""


def weight(sigma_range: float, sigma_bearing_deg: float, distance: Array) -> Array:
    """Return w_k (1/m²) of cameras at ``distance`` (K,), m.

    σ_t is the distance times ``sigma_bearing_deg``.
    """
    across = radians(sigma_bearing_deg) * np.maximum(distance, _MIN_DISTANCE_M)
    result: Array = 0.5 * (1.0 / across**2 - 1.0 / sigma_range**2)
    return result


def anisotropy(bearings: Array, weights: Array, prior: complex = 0j) -> complex:
    """Return s (1/m²) of cameras at ``bearings`` (K,), rad, with ``weights`` (K,) and the ``prior`` s₀."""
    return prior + complex(weights @ np.exp(2j * bearings))


def descent(
    bearings: Array, weights: Array, prior: complex = 0j, around: float = 0.0, apart: float = 0.0
) -> Array:
    """Return the directions (K,), rad, into which to turn each of ``bearings`` (K,), rad.

    ``weights`` (K,) and ``prior`` in 1/m²; ``around``: weight of the part all around. ``apart`` (rad):
    bearings nearer to each other than this part. Zeros if all weights are zero.
    """
    total = float(np.abs(weights).sum())
    if total == 0.0:
        return np.zeros(len(bearings))
    double = np.exp(2j * bearings)
    s = anisotropy(bearings, weights, prior)
    # A camera whose ray is the better known direction has a negative weight.
    result: Array = 2.0 * np.sign(weights) * np.imag(np.conj(s) * double) / total
    if len(bearings) > 2:
        further = _all_around(bearings, weights, around) + _parting(bearings, apart)
        result = result + _neutral(further, weights * double / total)
    return result


def aside(bearings: Array, weights: Array, prior: complex, size: float) -> Array:
    """Return the turns (K,), rad, by which bearings leave a saddle of |s|, in the order of the cameras.

    Cameras that are all on one line have no descent. Each is turned by up to ``size`` (rad), the first to the
    right, the last to the left.
    """
    count = len(bearings)
    if count < 2:
        return np.zeros(count)
    s = anisotropy(bearings, weights, prior)
    turned = np.conj(s) * np.exp(2j * bearings)
    along, slope = np.real(turned), np.abs(np.imag(turned))
    flat = (along > _SADDLE * weights) & (slope < size * np.abs(along))
    order = np.linspace(-1.0, 1.0, count)
    # The one in the middle of an odd number stays; the others move.
    return np.where(flat, size * order, 0.0)


def _all_around(bearings: Array, weights: Array, around: float) -> Array:
    """Return the descent (K,) of ½|Σ e^{iθ_j}|², divided as that of |s| is."""
    mean = np.exp(1j * bearings).mean()
    sizes = np.abs(weights)
    shares = np.maximum(sizes / sizes.mean(), _MIN_SHARE)
    result: Array = around / shares * np.imag(np.conj(mean) * np.exp(1j * bearings))
    return result


def _parting(bearings: Array, apart: float) -> Array:
    """Return the turns (K,), rad, of cameras away from those nearer than ``apart`` (rad)."""
    if apart <= 0.0:
        return np.zeros(len(bearings))
    off = wrapped(bearings[:, None] - bearings)
    result: Array = _PARTING * (np.sign(off) * np.maximum(0.0, 1.0 - np.abs(off) / apart)).sum(axis=1)
    return result


def _neutral(turn: Array, parts: Array) -> Array:
    """Return the part of ``turn`` (K,) that leaves s unchanged; ``parts`` (K,) are w_k e^{2iθ_k}/Σw."""
    slope = np.array([-2.0 * parts.imag, 2.0 * parts.real])
    gram = slope @ slope.T + _DAMPING / len(turn) * np.eye(2)
    result: Array = turn - slope.T @ np.linalg.solve(gram, slope @ turn)
    return result


class Crossing:
    """Way of one camera to the opposite bearing.

    Of two cameras that are in each other's way the one with the larger id crosses, if no other is near the
    opposite bearing.
    """

    def __init__(self) -> None:
        self._since: int | None = None
        self._sense, self._gone, self._last = 0.0, 0.0, 0.0

    def sense(self, now: int, own: int, bearings: Array, apart: float, led: float) -> float:
        """Return +1 (left) or −1 while the camera crosses at ``now`` (µs), otherwise 0.

        ``own``: index of the camera in ``bearings`` (K,), rad, which are in the order of the ids. ``apart``:
        angle (rad) that cameras shall keep. ``led``: the own descent (rad), which opposes the first part of
        the way. The others turn meanwhile, so the length of the way is not known before.
        """
        here = float(bearings[own])
        if self._sense:
            self._gone += self._sense * float(wrapped(np.array(here - self._last)))
            self._last = here
            if self._gone > _LONGEST or (self._gone > _BEYOND and led * self._sense > 0.0):
                self._sense = 0.0
            return self._sense
        off = wrapped(here - bearings)
        near = np.abs(off[:own]) < _CROWDED * apart
        opposite = np.abs(np.abs(off) - pi) < apart
        if not near.any() or opposite.any():
            self._since = None
            return 0.0
        self._since = now if self._since is None else self._since
        if now - self._since < _CROWDED_US:
            return 0.0
        nearest = int(np.argmin(np.abs(off[:own])))
        self._since, self._sense = None, 1.0 if off[nearest] >= 0.0 else -1.0
        self._gone, self._last = 0.0, here
        return self._sense
