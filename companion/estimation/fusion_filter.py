"""Arithmetic of the fusion filter: a Kalman filter over detections in the order of their images.

State (6 + 5M): position and velocity of the target (fleet-local ENU), then for each of M vehicles the errors
of its own estimate, which all its detections have in common: position (3), yaw and elevation of the ray.
The target's acceleration is white; each error is a first-order Gauss–Markov process. Treated as white noise,
a bias of GNSS would be averaged away within a second, and the filter would be far too confident.
"""

from __future__ import annotations

from math import exp, sqrt

import numpy as np
from numpy.typing import NDArray

from companion.values.compiled import BOOL, INT, VOID, array, kernel, output, part
from companion.values.horizon import Array

TARGET, PER_VEHICLE = 6, 5
"""Number of states of the target, and of each vehicle."""
FIELDS = 22
"""Numbers of a detection.

Place (3), covariance R of the camera alone (9, by rows), directions (3) into which yaw and elevation of the
ray move the place, the camera's place (3), and the measured distance; m.
"""
_KNOWN, _LEAST_SCALE = 25.0, 0.25
"""m²: with a smaller trace of the place's covariance, the distance to the estimated place is used.

Errors of yaw move the place in proportion to the true distance, and errors of pixels and height grow with it.
With the measured distance the filter would learn the yaw from its noise, and would trust too short distances
more than too long ones: a bias of 2σ² of the relative error. R is scaled by the square of the ratio, within
limits.
"""
_GAIN = 0.999
"""An estimate by others is used if it lowers the trace to less than this share."""
MEMORY = 0.1
"""Weight of a detection in the mean d² of its vehicle."""
SUSPECT = 2.0
"""Detections of a vehicle are refused while its mean d² is so many times that of others and of true ones."""
DEGREES_OF_FREEDOM = 3.0


@part
def _predict(x: Array, P: Array, dt: float, noise: Array) -> None:
    """Advance state and covariance by ``dt`` (s)."""
    n = len(x)
    for a in range(3):
        x[a] += dt * x[3 + a]
        for j in range(n):
            P[a, j] += dt * P[3 + a, j]
    for a in range(3):
        for j in range(n):
            P[j, a] += dt * P[j, 3 + a]
    q = noise[0] * dt
    for a in range(3):
        P[a, a] += q * dt * dt / 3.0
        P[a, 3 + a] += q * dt / 2.0
        P[3 + a, a] += q * dt / 2.0
        P[3 + a, 3 + a] += q
    for i in range(TARGET, n):
        kind = (i - TARGET) % PER_VEHICLE
        variance, rate = noise[2 + 2 * kind], noise[3 + 2 * kind]
        keep = exp(-dt * rate)
        x[i] *= keep
        for j in range(n):
            P[i, j] *= keep
        for j in range(n):
            P[j, i] *= keep
        P[i, i] += variance * (1.0 - keep * keep)


@part
def _inverse(S: Array, out: Array) -> None:
    """Write the inverse of the symmetric ``S`` (3, 3) to ``out``."""
    a, b, c = S[0, 0], S[0, 1], S[0, 2]
    d, e, f = S[1, 1], S[1, 2], S[2, 2]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    scale = 1.0 / (a * A + b * B + c * C)
    out[0, 0], out[0, 1], out[0, 2] = A * scale, B * scale, C * scale
    out[1, 0], out[1, 1], out[1, 2] = B * scale, (a * f - c * c) * scale, (b * c - a * e) * scale
    out[2, 0], out[2, 1], out[2, 2] = C * scale, (b * c - a * e) * scale, (a * d - b * b) * scale


@part
def _own_share(P: Array, R: Array) -> float:
    """Return ω of the covariance intersection of two estimates of the place, with covariances P, R (3, 3).

    It minimises the trace of (ω P⁻¹ + (1 − ω) R⁻¹)⁻¹, to 2 %; 1: the other estimate adds nothing.
    """
    A, B, C, D = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    _inverse(P, A)
    _inverse(R, B)
    best, least = 1.0, P[0, 0] + P[1, 1] + P[2, 2]
    for k in range(1, 50):
        share = 0.02 * k
        for i in range(3):
            for j in range(3):
                C[i, j] = share * A[i, j] + (1.0 - share) * B[i, j]
        _inverse(C, D)
        trace = D[0, 0] + D[1, 1] + D[2, 2]
        if trace < _GAIN * least:
            best, least = share, trace
    return best


@kernel(
    VOID,
    array(1, INT),
    array(1, INT),
    array(2),
    INT,
    INT,
    INT,
    array(1),
    array(2),
    array(1),
    array(1),
    output(2),
    output(3),
    output(2),
    output(1, BOOL),
    output(1),
)
def replay(
    times: NDArray[np.int64],
    slots: NDArray[np.int64],
    data: Array,
    first: int,
    count: int,
    began: int,
    x0: Array,
    P0: Array,
    means0: Array,
    noise: Array,
    X: Array,
    PP: Array,
    means: Array,
    used: NDArray[np.bool_],
    nis: Array,
) -> None:
    """Process the detections ``first`` … ``count`` − 1 and write what is known after each.

    ``times`` (N,), µs, ascending; ``slots`` (N,): index of the detecting vehicle, negative: the place is an
    estimate that may share detections with this one, combined by covariance intersection; ``data``
    (N, FIELDS). ``x0`` (n,), ``P0`` (n, n), ``means0`` (M,): before the first detection, at ``began`` (µs).
    ``noise`` (13,): spectral density of the acceleration, gate, variance and rate of decay (1/s) of each of
    the five errors of a vehicle, and the variance of its position that is not in common (m²). ``X`` (N, n),
    ``PP`` (N, n, n), ``means`` (N, M): after each detection; ``used`` (N,): whether it passed; ``nis`` (N,):
    its d².
    """
    n, vehicles = len(x0), len(means0)
    B, K, S, T = np.empty((n, 3)), np.empty((n, 3)), np.empty((3, 3)), np.empty((3, 3))
    y, place, R = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for i in range(first, count):
        if i == 0:
            X[i], PP[i], means[i] = x0, P0, means0
            elapsed = times[i] - began
        else:
            X[i], PP[i], means[i] = X[i - 1], PP[i - 1], means[i - 1]
            elapsed = times[i] - times[i - 1]
        x, P = X[i], PP[i]
        if elapsed > 0:
            _predict(x, P, 1e-6 * elapsed, noise)
        slot = slots[i]
        base = TARGET + PER_VEHICLE * slot
        for a in range(3):
            for b in range(3):
                R[a, b], place[a, b] = data[i, 3 + 3 * a + b], P[a, b]
        distance = data[i, 21]
        if slot >= 0:
            if place[0, 0] + place[1, 1] + place[2, 2] < _KNOWN:
                square = 0.0
                for a in range(3):
                    square += (x[a] - data[i, 18 + a]) ** 2
                distance = sqrt(square)
            scale = min(max((distance / data[i, 21]) ** 2, _LEAST_SCALE), 1.0 / _LEAST_SCALE)
            for a in range(3):
                for b in range(3):
                    R[a, b] *= scale
                R[a, a] += noise[12]
        for a in range(3):
            g, h = distance * data[i, 12 + a], distance * data[i, 15 + a]
            y[a] = data[i, a] - x[a]
            if slot >= 0:
                y[a] -= x[base + a] + g * x[base + 3] + h * x[base + 4]
            for j in range(n):
                B[j, a] = P[j, a]
                if slot >= 0:
                    B[j, a] += P[j, base + a] + g * P[j, base + 3] + h * P[j, base + 4]
        for a in range(3):
            for b in range(3):
                g, h = distance * data[i, 12 + a], distance * data[i, 15 + a]
                S[a, b] = B[a, b] + R[a, b]
                if slot >= 0:
                    S[a, b] += B[base + a, b] + g * B[base + 3, b] + h * B[base + 4, b]
        _inverse(S, T)
        d2 = 0.0
        for a in range(3):
            for b in range(3):
                d2 += y[a] * T[a, b] * y[b]
        nis[i] = d2
        passes = d2 <= noise[1]
        if slot >= 0:
            others, number = 0.0, 0
            for k in range(vehicles):
                if k != slot and means[i, k] > 0.0:
                    others += means[i, k]
                    number += 1
            before = means[i, slot] if means[i, slot] > 0.0 else DEGREES_OF_FREEDOM
            means[i, slot] = before + MEMORY * (min(d2, noise[1]) - before)
            if number > 0:
                passes = passes and means[i, slot] <= SUSPECT * max(DEGREES_OF_FREEDOM, others / number)
        used[i] = passes
        if not passes:
            continue
        if slot < 0:
            share = _own_share(place, R)
            if share == 1.0:
                continue
            # P/ω and R/(1 − ω) are combined as if they were independent.
            for j in range(n):
                for k in range(n):
                    P[j, k] /= share
            for a in range(3):
                for j in range(n):
                    B[j, a] /= share
                for b in range(3):
                    S[a, b] = B[a, b] + R[a, b] / (1.0 - share)
            _inverse(S, T)
        for j in range(n):
            for a in range(3):
                K[j, a] = B[j, 0] * T[0, a] + B[j, 1] * T[1, a] + B[j, 2] * T[2, a]
        for j in range(n):
            x[j] += K[j, 0] * y[0] + K[j, 1] * y[1] + K[j, 2] * y[2]
        for j in range(n):
            for k in range(j + 1):
                left = P[j, k] - (K[j, 0] * B[k, 0] + K[j, 1] * B[k, 1] + K[j, 2] * B[k, 2])
                P[j, k] = left
                P[k, j] = left


def worst_sigma(P: Array) -> float:
    """Return σ along the worst axis of a covariance ``P`` (3, 3)."""
    return sqrt(max(float(np.linalg.eigvalsh(P)[-1]), 0.0))
