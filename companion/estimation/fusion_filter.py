"""Arithmetic of the fusion filter: a Kalman filter over detections in the order of their images.

State (9 + 5M): position, velocity and acceleration of the target (fleet-local ENU), then for each of M
vehicles the errors of its own estimate, which all its detections have in common: position (3), yaw and
elevation of the ray. The target's acceleration is exponentially correlated (R. A. Singer, Estimating optimal
tracking filter performance for manned maneuvering targets, IEEE Trans. AES-6(4), 1970); each error is a
first-order Gauss–Markov process. Treated as white noise, a bias of GNSS would be averaged away within a
second, and the filter would be far too confident.

The variance of the acceleration, one of both horizontal axes and one of the vertical, is e^θ times the
configured one. θ has a normal prior around 0 and follows the innovations y by recursive maximum likelihood
with exponential forgetting. With S = cov y, u = S⁻¹y and the sensitivity D = ∂P/∂θ of the target's
covariance, the score is ½(uᵀDu − tr S⁻¹D) and its information ½ tr (S⁻¹D)². In D the target's correlation
with the vehicles' errors is left out. A refused detection counts only if another one that was refused shortly
before agrees with it: false ones do not agree, those of a target that turned do. The σ of the acceleration is
at least ``LEAST_SHARE`` of the configured one, because innovations of a straight walk say nothing of the next
corner.
"""

from __future__ import annotations

from math import exp, log, sqrt

import numpy as np
from numpy.typing import NDArray

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
_SMOOTH_S, _LONGEST_S = 0.5, 1.0
"""Time constant with which a camera's velocity follows differences of its places; longest of these (s)."""
WHITE_SHARE = 0.02
"""Of the target's acceleration, the part that is white: a share of the spectral density at 0 Hz.

With it the velocity may change at once, as that of a recorded target does.
"""
LEAST_SHARE = 0.5
"""Least σ of the acceleration, as a share of the configured one."""
_LEAST_THETA = 2.0 * log(LEAST_SHARE)
_PRIOR, _LEAST_INFORMATION = 1.0, 0.25
"""Information of the prior of θ (σ = 1), and what is taken to be known at least, so that steps are small."""
_SERIES = 0.05
"""Below this time in time constants covariances are a series, because the closed form cancels."""
_KNOWN, _LEAST_SCALE = 25.0, 0.25
"""m²: with a smaller trace of the place's covariance, the distance to the estimated place is used.

Errors of yaw move the place in proportion to the true distance, and errors of pixels and height grow with it.
With the measured distance the filter would learn the yaw from its noise, and would trust too short distances
more than too long ones: a bias of 2σ² of the relative error. R is scaled by the square of the ratio, within
limits. So is the direction: R is long along the ray and thin across it. With the measured ray as axis, an
error n across the ray looks like one along it of −n²/r (r: distance), which R trusts as an error across: the
place comes nearer to the camera by 2σ_l²/r, 0.11 m where σ_l along the ray is 0.65 m at 7.8 m, however small
the error across is. The axis is therefore the ray on which the detection is expected.
"""
_LEAST_LEVEL = 0.1
"""Cosine of the elevation below which the measured axes are used: yaw moves nothing straight below."""
_GAIN = 0.999
"""An estimate by others is used if it lowers the trace to less than this share."""
_CONFIRMED_S = 0.5
"""A refused detection says something of the acceleration if the one refused before it, at most this time (s)
earlier, agrees with it."""
AGREE_M, AGREE_M_S = 2.0, 3.0
"""Detections agree if the places differ by at most a length plus a speed times the time between."""
MEMORY = 0.1
"""Weight of a detection in the mean d² of its vehicle."""
SUSPECT = 2.0
"""Detections of a vehicle are refused while its mean d² is so many times that of others and of true ones."""
DEGREES_OF_FREEDOM = 3.0


@part
def _motion(dt: float, rate: float, F: Array, Q: Array) -> None:
    """Write the motion of one axis in ``dt`` (s), for an acceleration of variance 1 that decays at ``rate``.

    ``F`` (4,): what velocity and acceleration add to the position, the acceleration to the velocity, and what
    is left of the acceleration. ``Q`` (6,): covariance of position, velocity and acceleration, upper triangle
    by rows, with the white part.
    """
    x = rate * dt
    e = exp(-x)
    F[0], F[3] = dt, e
    if x < _SERIES:
        s = 2.0 * x
        F[1] = dt * dt * (0.5 - x / 6.0 + x * x / 24.0)
        F[2] = dt * (1.0 - x / 2.0 + x * x / 6.0)
        Q[0] = s * dt**4 * (1.0 / 20.0 - x / 36.0 + x * x * 5.0 / 504.0)
        Q[1] = s * dt**3 * (1.0 / 8.0 - x / 12.0 + x * x * 5.0 / 144.0)
        Q[2] = s * dt**2 * (1.0 / 6.0 - x / 6.0 + x * x * 11.0 / 120.0)
        Q[3] = s * dt**2 * (1.0 / 3.0 - x / 4.0 + x * x * 7.0 / 60.0)
        Q[4] = s * dt * (1.0 / 2.0 - x / 2.0 + x * x * 7.0 / 24.0)
    else:
        F[1], F[2] = (x - 1.0 + e) / rate**2, (1.0 - e) / rate
        Q[0] = (1.0 - e * e + 2.0 * x + 2.0 * x**3 / 3.0 - 2.0 * x * x - 4.0 * x * e) / rate**4
        Q[1] = (1.0 + e * e - 2.0 * e + 2.0 * x * e - 2.0 * x + x * x) / rate**3
        Q[2] = (1.0 - e * e - 2.0 * x * e) / rate**2
        Q[3] = (4.0 * e - 3.0 - e * e + 2.0 * x) / rate**2
        Q[4] = (1.0 + e * e - 2.0 * e) / rate
    Q[5] = 1.0 - e * e
    white = WHITE_SHARE * 2.0 / rate
    Q[0] += white * dt**3 / 3.0
    Q[1] += white * dt * dt / 2.0
    Q[3] += white * dt


@part
def _advance(P: Array, F: Array) -> None:
    """Advance a covariance that begins with the target's states, without noise."""
    n = len(P)
    for a in range(3):
        for j in range(n):
            P[a, j] += F[0] * P[3 + a, j] + F[1] * P[6 + a, j]
            P[3 + a, j] += F[2] * P[6 + a, j]
            P[6 + a, j] *= F[3]
    for j in range(n):
        for a in range(3):
            P[j, a] += F[0] * P[j, 3 + a] + F[1] * P[j, 6 + a]
            P[j, 3 + a] += F[2] * P[j, 6 + a]
            P[j, 6 + a] *= F[3]


@part
def _disturb(P: Array, a: int, Q: Array, variance: float) -> None:
    """Add the noise of axis ``a`` to a covariance."""
    v, w = 3 + a, 6 + a
    P[a, a] += variance * Q[0]
    P[v, v] += variance * Q[3]
    P[w, w] += variance * Q[5]
    P[a, v] += variance * Q[1]
    P[a, w] += variance * Q[2]
    P[v, w] += variance * Q[4]
    P[v, a], P[w, a], P[w, v] = P[a, v], P[a, w], P[v, w]


@part
def _advance_errors(x: Array, P: Array, base: int, dt: float, noise: Array) -> None:
    """Advance the errors of one vehicle, the states from ``base`` on, by ``dt`` (s)."""
    n = len(x)
    for kind in range(PER_VEHICLE):
        i = base + kind
        variance, rate = noise[_ERRORS + 2 * kind], noise[_ERRORS + 1 + 2 * kind]
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
def _variance(P: Array, base: int, along: Array, yaw: float, elevation: float) -> float:
    """Return the variance (m²), by ``P``, of an expected detection ``along`` a direction (3,).

    ``base``: place of the errors of its vehicle; ``yaw`` and ``elevation``: m per rad, along the direction.
    """
    total = 0.0
    for i in range(8):
        j = i if i < 3 else base + i - 3
        weight = along[i % 3] if i < 6 else (yaw if i == 6 else elevation)
        for k in range(8):
            m = k if k < 3 else base + k - 3
            total += weight * P[j, m] * (along[k % 3] if k < 6 else (yaw if k == 6 else elevation))
    return total


@part
def _expected(
    x: Array, P: Array, base: int, distance: float, row: Array, R: Array, sideways: Array, up: Array
) -> None:
    """Write the covariance R (3, 3) of the camera, and the directions of yaw and elevation, (3,).

    They are those of the detection ``row`` (FIELDS,), turned from the measured ray to the one on which it is
    expected: from the camera to the estimated place, by the estimated errors of its vehicle, the states ``x``
    from ``base`` on. ``distance`` (m): of the estimated place. By the error of this direction, by ``P``, an
    error along the ray is one across the axis: R is so much wider.
    """
    ahead, measured = np.empty(3), np.empty(3)
    for a in range(3):
        measured[a] = row[a] - row[18 + a]
        ahead[a] = x[a] + x[base + a] - row[18 + a]
        ahead[a] += distance * (row[12 + a] * x[base + 3] + row[15 + a] * x[base + 4])
    length = sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1] + ahead[2] * ahead[2])
    level = sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1])
    flat = sqrt(sideways[0] * sideways[0] + sideways[1] * sideways[1])
    far = sqrt(measured[0] * measured[0] + measured[1] * measured[1] + measured[2] * measured[2])
    if not (level > _LEAST_LEVEL * length and flat > _LEAST_LEVEL and far > 0.0):
        return
    along = high = wide = 0.0
    for a in range(3):
        for b in range(3):
            along += measured[a] * R[a, b] * measured[b] / (far * far)
            high += up[a] * R[a, b] * up[b]
            wide += sideways[a] * R[a, b] * sideways[b] / (flat * flat)
    sideways[0], sideways[1], sideways[2] = -ahead[1] / length, ahead[0] / length, 0.0
    up[0], up[1] = -ahead[2] * ahead[0] / (level * length), -ahead[2] * ahead[1] / (level * length)
    up[2] = level / length
    for a in range(3):
        measured[a] = sideways[a] * length / level
    share = along / (length * length)
    wide += share * _variance(P, base, measured, distance * level / length, 0.0)
    high += share * _variance(P, base, up, 0.0, distance)
    for a in range(3):
        for b in range(3):
            R[a, b] = (along - wide) * ahead[a] * ahead[b] / (length * length) + (high - wide) * up[a] * up[b]
        R[a, a] += wide


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


@part
def _confirmed(memory: Array, row: Array) -> bool:
    """Return whether a refused detection ``row`` (FIELDS,) agrees with the last one, and remember it."""
    left, square = memory[_REFUSED], 0.0
    for a in range(3):
        square += (row[a] - memory[_REFUSED + 1 + a]) ** 2
        memory[_REFUSED + 1 + a] = row[a]
    memory[_REFUSED] = _CONFIRMED_S
    apart = AGREE_M + AGREE_M_S * (_CONFIRMED_S - left)
    agrees: bool = left > 0.0 and square <= apart * apart
    return agrees


@part
def _adapt(
    memory: Array, D: Array, group: int, u: Array, T: Array, clip: float, keep: float, noise: Array
) -> None:
    """Move θ of ``group`` by what one detection says.

    ``u`` (3,), its square times ``clip``; ``T`` (3, 3): S⁻¹; ``keep``: what is left of θ's information.
    """
    score, information = 0.0, 0.0
    for a in range(3):
        for b in range(3):
            score += 0.5 * (clip * u[a] * u[b] - T[a, b]) * D[a, b]
            for c in range(3):
                for d in range(3):
                    information += 0.5 * T[a, b] * D[b, c] * T[c, d] * D[d, a]
    known = keep * memory[_INFORMATION + group] + information
    memory[_INFORMATION + group] = known
    theta = memory[group]
    gain = 1.0 / (known + _LEAST_INFORMATION)
    # What is forgotten is replaced by the prior.
    step = gain * (score - theta * (1.0 - keep) * _PRIOR)
    memory[group] = min(max(theta + step, _LEAST_THETA), noise[_BOUND])


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
    n, vehicles = len(x0), (len(memory0) - ADAPTED) // MARKS
    B, K, S, T = np.empty((n, 3)), np.empty((n, 3)), np.empty((3, 3)), np.empty((3, 3))
    y, u, place, R = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    F, Q, L, moved = np.empty(4), np.empty(6), np.empty((TARGET, TARGET)), np.zeros(3)
    sideways, up = np.empty(3), np.empty(3)
    for i in range(first, count):
        if i == 0:
            X[i], PP[i], memories[i] = x0, P0, memory0
            elapsed = times[i] - began
        else:
            X[i], PP[i], memories[i] = X[i - 1], PP[i - 1], memories[i - 1]
            elapsed = times[i] - times[i - 1]
        x, P, memory = X[i], PP[i], memories[i]
        DD = memory[SENSITIVITY:_REFUSED].reshape((GROUPS, TARGET, TARGET))
        dt = 1e-6 * elapsed
        if elapsed > 0:
            _motion(dt, noise[_DECAY], F, Q)
            for a in range(3):
                x[a] += F[0] * x[3 + a] + F[1] * x[6 + a]
                x[3 + a] += F[2] * x[6 + a]
                x[6 + a] *= F[3]
            _advance(P, F)
            for group in range(GROUPS):
                _advance(DD[group], F)
            for a in range(3):
                group = a // 2
                variance = noise[_VARIANCES + group] * exp(memory[group])
                _disturb(P, a, Q, variance)
                _disturb(DD[group], a, Q, variance)
            memory[_REFUSED] -= dt
            for k in range(vehicles):
                memory[ADAPTED + MARKS * k + 1] += dt
        slot = slots[i]
        base, mark = TARGET + PER_VEHICLE * slot, ADAPTED + MARKS * slot
        moved[:], lead = 0.0, 0.0
        if slot >= 0:
            since = memory[mark + 1]
            if since > 0.0:
                _advance_errors(x, P, base, since, noise)
            memory[mark + 1] = 0.0
            follow = 1.0 - exp(-since / _SMOOTH_S) if since > 0.0 and memory[mark] > 0.0 else 0.0
            lead = noise[_AGE] * follow / max(since, 1e-6)
            for a in range(3):
                at, speed = mark + 2 + a, mark + 5 + a
                if since > _LONGEST_S:
                    memory[speed] = 0.0
                elif follow > 0.0:
                    memory[speed] += follow * ((data[i, 18 + a] - memory[at]) / since - memory[speed])
                memory[at] = data[i, 18 + a]
                # The place is that of an older estimate; the vehicle has moved on since.
                moved[a] = noise[_AGE] * memory[speed]
        for a in range(3):
            for b in range(3):
                R[a, b], place[a, b] = data[i, 3 + 3 * a + b], P[a, b]
            sideways[a], up[a] = data[i, 12 + a], data[i, 15 + a]
        distance = data[i, 21]
        if slot >= 0:
            if place[0, 0] + place[1, 1] + place[2, 2] < _KNOWN:
                square = 0.0
                for a in range(3):
                    square += (x[a] - data[i, 18 + a]) ** 2
                distance = sqrt(square)
                _expected(x, P, base, distance, data[i], R, sideways, up)
            scale = min(max((distance / data[i, 21]) ** 2, _LEAST_SCALE), 1.0 / _LEAST_SCALE)
            for a in range(3):
                for b in range(3):
                    R[a, b] *= scale
                # The velocity has a part of this error.
                R[a, a] += noise[_WHITE] * (1.0 + lead) ** 2
                for b in range(3):
                    # An image that is late shows the target where it was.
                    R[a, b] += noise[_TIME] * x[3 + a] * x[3 + b]
        for a in range(3):
            g, h = distance * sideways[a], distance * up[a]
            y[a] = data[i, a] + moved[a] - x[a]
            if slot >= 0:
                y[a] -= x[base + a] + g * x[base + 3] + h * x[base + 4]
            for j in range(n):
                B[j, a] = P[j, a]
                if slot >= 0:
                    B[j, a] += P[j, base + a] + g * P[j, base + 3] + h * P[j, base + 4]
        for a in range(3):
            for b in range(3):
                g, h = distance * sideways[a], distance * up[a]
                S[a, b] = B[a, b] + R[a, b]
                if slot >= 0:
                    S[a, b] += B[base + a, b] + g * B[base + 3, b] + h * B[base + 4, b]
        _inverse(S, T)
        d2 = 0.0
        for a in range(3):
            u[a] = T[a, 0] * y[0] + T[a, 1] * y[1] + T[a, 2] * y[2]
            d2 += y[a] * u[a]
        nis[i] = d2
        passes = d2 <= noise[_GATE]
        if slot >= 0:
            others, number = 0.0, 0
            for k in range(vehicles):
                mean = memory[ADAPTED + MARKS * k]
                if k != slot and mean > 0.0:
                    others += mean
                    number += 1
            before = memory[mark] if memory[mark] > 0.0 else DEGREES_OF_FREEDOM
            memory[mark] = before + MEMORY * (min(d2, noise[_GATE]) - before)
            trusted = number == 0 or memory[mark] <= SUSPECT * max(DEGREES_OF_FREEDOM, others / number)
            says = trusted
            if d2 > noise[_GATE]:
                says = trusted and _confirmed(memory, data[i])
            passes = passes and trusted
            if says and noise[_BOUND] > 0.0:
                clip = min(1.0, noise[_GATE] / max(d2, 1e-9))
                for group in range(GROUPS):
                    _adapt(memory, DD[group], group, u, T, clip, exp(-dt * noise[_FORGET]), noise)
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
        # D is (I − KH) D (I − KH)ᵀ after it, with H that of the place.
        for group in range(GROUPS):
            D = DD[group]
            for j in range(TARGET):
                for k in range(TARGET):
                    L[j, k] = D[j, k] - (K[j, 0] * D[0, k] + K[j, 1] * D[1, k] + K[j, 2] * D[2, k])
            for j in range(TARGET):
                for k in range(TARGET):
                    D[j, k] = L[j, k] - (L[j, 0] * K[k, 0] + L[j, 1] * K[k, 1] + L[j, 2] * K[k, 2])


@kernel(VOID, FLOAT, FLOAT, array(1), array(2), array(1), array(1), output(1), output(2))
def ahead(
    dt: float, moving: float, x: Array, P: Array, memory: Array, noise: Array, state: Array, covariance: Array
) -> None:
    """Write what is known ``dt`` s after a detection: ``state`` (9,), and ``covariance`` (3, 3) of the place.

    ``x`` (n,), ``P`` (n, n), ``memory``: after it. The target moves for ``moving`` s and rests then.
    """
    F, Q, C = np.empty(4), np.empty(6), np.empty((TARGET, TARGET))
    _motion(moving, noise[_DECAY], F, Q)
    rests = moving < dt
    for a in range(3):
        state[a] = x[a] + F[0] * x[3 + a] + F[1] * x[6 + a]
        state[3 + a] = 0.0 if rests else x[3 + a] + F[2] * x[6 + a]
        state[6 + a] = 0.0 if rests else F[3] * x[6 + a]
    C[:] = P[:TARGET, :TARGET]
    _motion(dt, noise[_DECAY], F, Q)
    _advance(C, F)
    for a in range(3):
        _disturb(C, a, Q, noise[_VARIANCES + a // 2] * exp(memory[a // 2]))
    covariance[:] = C[:3, :3]


def worst_sigma(P: Array) -> float:
    """Return σ along the worst axis of a covariance ``P`` (3, 3)."""
    return sqrt(max(float(np.linalg.eigvalsh(P)[-1]), 0.0))
