"""Measurement update of one sender's filter state: gate, Kalman filter and competing hypotheses.

The state is [p, v] per axis; the model is constant velocity with white acceleration. A measurement is
position and velocity, as in GLOBAL_POSITION_INT and LOCAL_POSITION_NED, or position alone, as FOLLOW_TARGET
and cameras may send it. The three axes have the same model and the same noise, hence one gain and one
covariance P (2, 2). Together they are exactly the filter of six states with covariance P ⊗ I₃
(``kalman_gains``).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from companion.config.estimation import TrackConfig
from companion.estimation.kalman_gains import Noise, Square, gain, prepared
from companion.estimation.turn_rate import Turn, TurnFilter

Six = tuple[float, float, float, float, float, float]
"""Position (m) and velocity (m/s), fleet-local ENU.

Floats, not arrays: numpy operations on six elements would take longer than the rest of a step.
"""

Three = tuple[float, float, float]
"""Position (m) alone."""
Measured = Six | Three

_BLIND = 1e4
"""m/s: σ of the velocity for a measurement without one, so large that it has no effect."""
_ANY_SPEED = 5.0
"""m/s: σ of the velocity of a sender that has reported positions, but never a velocity."""
_DOUBTS = 4
"""Maximum number of hypotheses beside the current state."""
_STEPS = 2048
"""Number of cached steps: one second's worth for two hundred senders."""


class RefusedMeasurement(NamedTuple):
    """The last of ``witnesses`` refused measurements that agree with each other, true at ``time`` (µs)."""

    time: int
    z: Six
    witnesses: int


class Belief(NamedTuple):
    """Filter state of one sender: state vector, covariance P (2, 2) of each axis row by row, and turn rate.

    ``time``: when the last accepted measurement was true, µs; ``refused``: number of measurements that were
    not accepted.
    """

    time: int
    x: Six
    P: Square
    turn: Turn
    doubts: tuple[RefusedMeasurement, ...]
    refused: int


class Estimator:
    """Steps from filter state to filter state.

    ``after`` is a pure function of its arguments: if many companions in one process receive the same sender,
    the first one computes the step and the others use the cached result.
    """

    def __init__(self, config: TrackConfig) -> None:
        self._noise = Noise(config.sigma_position, config.sigma_velocity, config.sigma_acceleration)
        prepared(self._noise)
        self._blind = self._noise._replace(velocity=_BLIND)
        self._first: Square = (config.sigma_position**2, 0.0, 0.0, config.sigma_velocity**2)
        self._first_blind: Square = (config.sigma_position**2, 0.0, 0.0, _ANY_SPEED**2)
        self._turning = TurnFilter(config.sigma_turn, 1e-6 * config.turn_memory_us, config.sigma_velocity)
        self._gate = config.gate
        self._jump = config.jump
        self._witnesses = config.witnesses
        self.after = lru_cache(maxsize=_STEPS)(self._after)

    def _after(self, belief: Belief | None, time: int, z: Measured) -> Belief:
        """Return the filter state after a measurement ``z`` that was true at ``time`` (µs).

        ``time`` is no earlier than the previous state's. The measurement is refused when d² = yᵀS⁻¹y exceeds
        the gate (χ² of six), or when it lies further from the prediction than ``jump`` metres, or would do so
        within a second, for every second since the last measurement plus one. Refused measurements agree when
        each lies within that distance of the extrapolation of the one before it: after ``witnesses`` of them
        the state restarts at the last one. They need not fit the motion model; otherwise a sender that
        manoeuvres harder than the model assumes would be locked out.

        A measurement of position alone gives no turn rate: velocities derived from positions lag behind.
        """
        if len(z) == 3:
            return self._after_place(belief, time, z)
        if belief is None:
            return Belief(time, z, self._first, self._turning.prior, (), 0)
        elapsed = time - belief.time
        (s, t, u), (j, k, m, n), P = gain(self._noise, belief.P, elapsed)
        # x = F x and y = z − x, then x + K y: per axis the position, then the velocity.
        dt = 1e-6 * elapsed
        a, b, c, d, e, f = belief.x
        a, b, c = a + dt * d, b + dt * e, c + dt * f
        ya, yb, yc, yd, ye, yf = z[0] - a, z[1] - b, z[2] - c, z[3] - d, z[4] - e, z[5] - f
        far, fast = ya * ya + yb * yb + yc * yc, yd * yd + ye * ye + yf * yf
        distance = u * far - 2.0 * t * (ya * yd + yb * ye + yc * yf) + s * fast
        if max(far, fast) > self._most(elapsed) ** 2 or distance > self._gate * (s * u - t * t):
            return self._doubt(belief, time, z, self._first)
        x = (
            a + j * ya + k * yd,
            b + j * yb + k * ye,
            c + j * yc + k * yf,
            d + m * ya + n * yd,
            e + m * yb + n * ye,
            f + m * yc + n * yf,
        )
        turn = self._turning.updated(belief.turn, dt, (d, e), (x[3], x[4]))
        return Belief(time, x, P, turn, (), belief.refused)

    def _after_place(self, belief: Belief | None, time: int, z: Three) -> Belief:
        """Update with a position alone.

        The innovation of the velocity is 0 and its measurement noise is very large.
        """
        if belief is None:
            return Belief(time, (*z, 0.0, 0.0, 0.0), self._first_blind, self._turning.prior, (), 0)
        elapsed = time - belief.time
        (s, t, u), (j, _, m, _), P = gain(self._blind, belief.P, elapsed)
        dt = 1e-6 * elapsed
        a, b, c, d, e, f = belief.x
        a, b, c = a + dt * d, b + dt * e, c + dt * f
        ya, yb, yc = z[0] - a, z[1] - b, z[2] - c
        far = ya * ya + yb * yb + yc * yc
        if far > self._most(elapsed) ** 2 or u * far > self._gate * (s * u - t * t):
            return self._doubt(belief, time, (*z, d, e, f), self._first_blind)
        x = (a + j * ya, b + j * yb, c + j * yc, d + m * ya, e + m * yb, f + m * yc)
        return Belief(time, x, P, self._turning.prior, (), belief.refused)

    def _doubt(self, belief: Belief, time: int, z: Six, first: Square) -> Belief:
        doubts = list(belief.doubts)
        witnesses = 1
        for index, (since, x, agreeing) in enumerate(doubts):
            dt = 1e-6 * (time - since)
            off = (z[axis] - x[axis] - dt * x[axis + 3] for axis in range(3))
            if sum(part * part for part in off) <= self._most(time - since) ** 2:
                witnesses = agreeing + 1
                del doubts[index]
                break
        if witnesses >= self._witnesses:
            return Belief(time, z, first, self._turning.prior, (), belief.refused)
        doubts.append(RefusedMeasurement(time, z, witnesses))
        return belief._replace(doubts=tuple(doubts[-_DOUBTS:]), refused=belief.refused + 1)

    def _most(self, elapsed: int) -> float:
        return self._jump * (1.0 + 1e-6 * elapsed)


@lru_cache(maxsize=64)
def estimator(config: TrackConfig) -> Estimator:
    """Return the estimator shared by all tracks with the same settings."""
    return Estimator(config)
