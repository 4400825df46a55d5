"""Arithmetic of the fusion filter: a Kalman filter over detections in the order of their images.

State (9 + 5M): position, velocity and acceleration of the target (fleet-local ENU), then for each of M
vehicles the errors of its own estimate, which all its detections have in common: position (3), yaw and
elevation of the ray. Treated as white noise, a bias of GNSS would be averaged away within a second, and the
filter would be far too confident.
"""

from __future__ import annotations

from math import exp

import numpy as np
from numpy.typing import NDArray

from companion.estimation.acceleration_adaptation import adapted, confirmed, correct
from companion.estimation.covariance_intersection import intersect
from companion.estimation.expected_ray import expect
from companion.estimation.fusion_motion import advance, advance_errors, advance_state, disturb, motion
from companion.estimation.symmetric_inverse import inverse
from companion.estimation.vehicle_marks import follow_camera, trusted
from companion.values.compiled import BOOL, FLOAT, INT, VOID, array, kernel, output, part
from companion.values.horizon import Array

TARGET, PER_VEHICLE = 9, 5
"""Number of states of the target, and of each vehicle."""
FIELDS = 22
"""Numbers of a detection.

Place (3), covariance R of the camera alone (9, by rows), directions (3) into which yaw and elevation of the
ray move the place, the camera's place (3), and the measured distance; m.
"""
_GATE, _WHITE, _VARIANCES, _DECAY, _FORGET, _BOUND, _AGE, _TIME, _ERRORS = 0, 1, 2, 4, 5, 6, 7, 8, 9
"""Places in ``noise``."""
NOISE = _ERRORS + 2 * PER_VEHICLE
"""Numbers of ``noise``.

Gate; variance of a vehicle's position that is not in common (m²); variances of the target's horizontal and
vertical acceleration (m²/s⁴); rates (1/s) at which the acceleration decays, and θ's information; bound of
θ; age (s) of a vehicle's own position; variance (s²) of an image's time; variance and rate of decay (1/s) of
each of the five errors of a vehicle.
"""
GROUPS = 2
"""Number of variances of the acceleration."""
_INFORMATION, SENSITIVITY = GROUPS, 2 * GROUPS
_REFUSED = SENSITIVITY + GROUPS * TARGET * TARGET
ADAPTED = _REFUSED + 4
"""Numbers of ``memory`` before those of the vehicles.

Each θ, its information, and its D (TARGET, TARGET); the seconds for which the last refused detection can
still be confirmed, and its place (3), m.
"""
MARKS = 8
"""Numbers of ``memory`` of each vehicle.

Mean d² (0 before its first detection), seconds since its last one, and the place (3) and the velocity (3) of
its camera then, m, m/s.
"""


@part
def _move(x: Array, P: Array, DD: Array, memory: Array, dt: float, noise: Array) -> None:
    """Move the target, and the times in ``memory``, on by ``dt`` (s); ``DD``: the sensitivities in it."""
    F, Q = np.empty(4), np.empty(6)
    motion(dt, noise[_DECAY], F, Q)
    advance_state(x, F)
    advance(P, F)
    for group in range(GROUPS):
        advance(DD[group], F)
    for a in range(3):
        group = a // 2
        variance = noise[_VARIANCES + group] * exp(memory[group])
        disturb(P, a, Q, variance)
        disturb(DD[group], a, Q, variance)
    memory[_REFUSED] -= dt
    for k in range((len(memory) - ADAPTED) // MARKS):
        memory[ADAPTED + MARKS * k + 1] += dt


@part
def _widen(R: Array, white: float, time: float, x: Array) -> None:
    """Add to R (3, 3) the variances ``white`` of each axis (m²), and ``time`` (s²) of the image's time."""
    for a in range(3):
        # The velocity has a part of this error.
        R[a, a] += white
        for b in range(3):
            # An image that is late shows the target where it was.
            R[a, b] += time * x[3 + a] * x[3 + b]


@part
def _compare(
    x: Array, P: Array, base: int, yaw: Array, elevation: Array, R: Array, y: Array, B: Array, S: Array
) -> None:
    """Subtract the expected place from the detected one ``y`` (3,); write B = cov(x, y) (n, 3), S = cov y.

    ``base``: first of the errors of its vehicle among the states; negative: it has none. ``yaw``,
    ``elevation`` (3,): what they add to the place, m per rad. ``R`` (3, 3): covariance of the detection.
    """
    for a in range(3):
        g, h = yaw[a], elevation[a]
        y[a] -= x[a]
        if base >= 0:
            y[a] -= x[base + a] + g * x[base + 3] + h * x[base + 4]
        for j in range(len(x)):
            B[j, a] = P[j, a]
            if base >= 0:
                B[j, a] += P[j, base + a] + g * P[j, base + 3] + h * P[j, base + 4]
    for a in range(3):
        for b in range(3):
            S[a, b] = B[a, b] + R[a, b]
            if base >= 0:
                S[a, b] += B[base + a, b] + yaw[a] * B[base + 3, b] + elevation[a] * B[base + 4, b]


@part
def _adapt(memory: Array, DD: Array, u: Array, T: Array, d2: float, dt: float, noise: Array) -> None:
    """Move each θ in ``memory`` by what a detection with S⁻¹y = ``u`` and S⁻¹ = ``T`` says."""
    clip, keep = min(1.0, noise[_GATE] / max(d2, 1e-9)), exp(-dt * noise[_FORGET])
    for group in range(GROUPS):
        theta, known = memory[group], memory[_INFORMATION + group]
        theta, known = adapted(theta, known, DD[group], u, T, clip, keep, noise[_BOUND])
        memory[group], memory[_INFORMATION + group] = theta, known


@part
def _update(x: Array, P: Array, y: Array, B: Array, T: Array, K: Array) -> None:
    """Update state and covariance by the innovation ``y`` (3,); write the gain K = B T (n, 3)."""
    n = len(x)
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
    memory0: Array,
    noise: Array,
    X: Array,
    PP: Array,
    memories: Array,
    used: NDArray[np.bool_],
    nis: Array,
) -> None:
    """Process the detections ``first`` … ``count`` − 1 and write what is known after each.

    ``times`` (N,), µs, ascending; ``slots`` (N,): index of the detecting vehicle, negative: the place is an
    estimate that may share detections with this one, combined by covariance intersection; ``data``
    (N, FIELDS). ``x0`` (n,), ``P0`` (n, n), ``memory0`` (ADAPTED + MARKS·M,): before the first detection, at
    ``began`` (µs). ``noise`` (NOISE,). ``X`` (N, n), ``PP`` (N, n, n), ``memories``: after each detection,
    the errors of a vehicle as of its own last one. ``used`` (N,): whether it passed; ``nis`` (N,): its d².
    """
    n, vehicles, gate = len(x0), (len(memory0) - ADAPTED) // MARKS, noise[_GATE]
    B, K, S, T, R = np.empty((n, 3)), np.empty((n, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    y, u, yaw, elevation, moved = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(first, count):
        if i == 0:
            X[i], PP[i], memories[i] = x0, P0, memory0
            elapsed = times[i] - began
        else:
            X[i], PP[i], memories[i] = X[i - 1], PP[i - 1], memories[i - 1]
            elapsed = times[i] - times[i - 1]
        x, P, memory, row, slot = X[i], PP[i], memories[i], data[i], slots[i]
        DD = memory[SENSITIVITY:_REFUSED].reshape((GROUPS, TARGET, TARGET))
        marks = memory[ADAPTED:].reshape((vehicles, MARKS))
        base, dt = (TARGET + PER_VEHICLE * slot if slot >= 0 else -1), 1e-6 * elapsed
        if elapsed > 0:
            _move(x, P, DD, memory, dt, noise)
        if slot >= 0:
            since = marks[slot, 1]
            if since > 0.0:
                advance_errors(x, P, base, since, noise[_ERRORS:])
            lead = follow_camera(marks[slot], row[18:21], noise[_AGE], moved)
            expect(x, P, base, row, R, yaw, elevation)
            _widen(R, noise[_WHITE] * (1.0 + lead) ** 2, noise[_TIME], x)
        else:
            moved[:] = 0.0
            R[:] = row[3:12].reshape((3, 3))
        for a in range(3):
            y[a] = row[a] + moved[a]
        _compare(x, P, base, yaw, elevation, R, y, B, S)
        inverse(S, T)
        d2 = 0.0
        for a in range(3):
            u[a] = T[a, 0] * y[0] + T[a, 1] * y[1] + T[a, 2] * y[2]
            d2 += y[a] * u[a]
        nis[i], used[i] = d2, d2 <= gate
        if slot >= 0:
            says = trusted(marks, slot, d2, gate)
            used[i] = used[i] and says
            if says and d2 > gate:
                says = confirmed(memory[_REFUSED:ADAPTED], row)
            if says and noise[_BOUND] > 0.0:
                _adapt(memory, DD, u, T, d2, dt, noise)
        if not used[i]:
            continue
        if slot < 0:
            if not intersect(P, R, B, S):
                continue
            inverse(S, T)
        _update(x, P, y, B, T, K)
        for group in range(GROUPS):
            correct(DD[group], K)


@kernel(VOID, FLOAT, FLOAT, array(1), array(2), array(1), array(1), output(1), output(2))
def ahead(
    dt: float, moving: float, x: Array, P: Array, memory: Array, noise: Array, state: Array, covariance: Array
) -> None:
    """Write what is known ``dt`` s after a detection: ``state`` (9,), and ``covariance`` (3, 3) of the place.

    ``x`` (n,), ``P`` (n, n), ``memory``: after it. The target moves for ``moving`` s and rests then.
    """
    F, Q, C = np.empty(4), np.empty(6), np.empty((TARGET, TARGET))
    motion(moving, noise[_DECAY], F, Q)
    rests = moving < dt
    for a in range(3):
        state[a] = x[a] + F[0] * x[3 + a] + F[1] * x[6 + a]
        state[3 + a] = 0.0 if rests else x[3 + a] + F[2] * x[6 + a]
        state[6 + a] = 0.0 if rests else F[3] * x[6 + a]
    C[:] = P[:TARGET, :TARGET]
    motion(dt, noise[_DECAY], F, Q)
    advance(C, F)
    for a in range(3):
        disturb(C, a, Q, noise[_VARIANCES + a // 2] * exp(memory[a // 2]))
    covariance[:] = C[:3, :3]
