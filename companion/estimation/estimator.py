"""Measurement update of one sender's filter state: gate, Kalman filter and competing hypotheses.

The state is [p, v] per axis; the model is constant velocity with white acceleration. A measurement is
position and velocity, as in GLOBAL_POSITION_INT and LOCAL_POSITION_NED, or position alone, as FOLLOW_TARGET
and cameras may send it. The three axes have the same model and the same noise, hence one gain and one
covariance P (2, 2) (``kalman_gains``). Together they equal the filter of six states with covariance P ⊗ I₃.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

from companion.config.estimation import TrackConfig
from companion.estimation.kalman_gains import Noise, Square, gain
from companion.estimation.turn_rate import Turn, TurnFilter

Six = tuple[float, float, float, float, float, float]
"""Position (m) and velocity (m/s), fleet-local ENU.

Floats, not arrays: numpy operations on six elements would take longer than the rest of a step.
"""

Three = tuple[float, float, float]
"""Position (m) alone."""
Measured = Six | Three

_NO_VELOCITY_SIGMA = 1e4
"""m/s: σ of the velocity for a measurement without velocity, so large that it has no effect."""
_UNKNOWN_VELOCITY_SIGMA = 5.0
"""m/s: σ of the velocity when a state starts or restarts at a measurement of position alone."""
_MAX_HYPOTHESES = 4
"""Maximum number of hypotheses that are kept beside the current state."""
_CACHE_SIZE = 2048
"""Number of cached filter steps: about one second of two hundred senders at 10 Hz."""


class RefusedMeasurement(NamedTuple):
    """Hypothesis: the last, ``z``, of ``witnesses`` refused measurements that agree, true at ``time`` (µs).

    For a measurement of position alone, ``z`` has the velocity of the filter state.
    """

    time: int
    z: Six
    witnesses: int


@dataclass(slots=True)
class Belief:
    """Filter state of one sender: state vector, covariance P (2, 2) of each axis row by row, and turn rate.

    ``time``: when the last accepted measurement was true, µs; ``doubts``: the hypotheses that contradict the
    state; ``refused``: number of measurements that were not accepted. Never changed: it is not ``frozen``
    because that triples the time to make one.
    """

    time: int
    x: Six
    P: Square
    turn: Turn
    doubts: tuple[RefusedMeasurement, ...]
    refused: int

    __hash__ = object.__hash__
    """By identity: a hash of all numbers would take as long as the step that the cache of ``after`` saves."""


class Estimator:
    """Steps from filter state to filter state.

    ``after`` is a pure function of its arguments: if many companions in one process receive the same sender,
    the first one computes the step and the others use the cached result.
    """

    def __init__(self, config: TrackConfig) -> None:
        self._noise = Noise(config.sigma_position, config.sigma_velocity, config.sigma_acceleration)
        self._noise_no_velocity = self._noise._replace(velocity=_NO_VELOCITY_SIGMA)
        self._first: Square = (config.sigma_position**2, 0.0, 0.0, config.sigma_velocity**2)
        self._first_no_velocity: Square = (config.sigma_position**2, 0.0, 0.0, _UNKNOWN_VELOCITY_SIGMA**2)
        self._turning = TurnFilter(config.sigma_turn, 1e-6 * config.turn_memory_us, config.sigma_velocity)
        self._gate = config.gate
        self._jump = config.jump
        self._witnesses = config.witnesses
        self.after = lru_cache(maxsize=_CACHE_SIZE)(self._after)

    def _after(self, belief: Belief | None, time: int, z: Measured) -> Belief:
        """Return the filter state after a measurement ``z`` that was true at ``time`` (µs).

        ``time`` is no earlier than the previous state's. The measurement is refused when d² = yᵀS⁻¹y exceeds
        the gate (χ² of six), or when the innovation of the position (m) or of the velocity (m/s) exceeds
        ``jump`` · (1 + seconds since the last accepted measurement). Two refused measurements agree when the
        position of the later one lies within ``jump`` · (1 + seconds between them), in m, of the
        extrapolation of the earlier one. After ``witnesses`` that agree in succession the state restarts at
        the last one. They need not fit the motion model; otherwise a sender that manoeuvres harder than the
        model assumes would be locked out.

        A measurement of position alone resets the turn rate: velocities derived from positions lag behind.
        """
        if len(z) == 3:
            return self._after_position(belief, time, z)
        if belief is None:
            return Belief(time, z, self._first, self._turning.prior, (), 0)
        elapsed = time - belief.time
        (s, t, u), (j, k, m, n), P = gain(self._noise, belief.P, elapsed)
        # x = F x and y = z − x, then x + K y: per axis the position, then the velocity.
        dt = 1e-6 * elapsed
        a, b, c, d, e, f = belief.x
        a, b, c = a + dt * d, b + dt * e, c + dt * f
        ya, yb, yc, yd, ye, yf = z[0] - a, z[1] - b, z[2] - c, z[3] - d, z[4] - e, z[5] - f
        squared_offset, squared_velocity_offset = ya * ya + yb * yb + yc * yc, yd * yd + ye * ye + yf * yf
        d2_times_det = (
            u * squared_offset - 2.0 * t * (ya * yd + yb * ye + yc * yf) + s * squared_velocity_offset
        )
        jump = (self._jump * (1.0 + dt)) ** 2
        if (
            squared_offset > jump
            or squared_velocity_offset > jump
            or d2_times_det > self._gate * (s * u - t * t)
        ):
            return self._refuse_or_restart(belief, time, z, self._first)
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

    def _after_position(self, belief: Belief | None, time: int, z: Three) -> Belief:
        """Update with a position alone.

        The innovation of the velocity is 0 and its measurement noise is very large.
        """
        if belief is None:
            return Belief(time, (*z, 0.0, 0.0, 0.0), self._first_no_velocity, self._turning.prior, (), 0)
        elapsed = time - belief.time
        (s, t, u), (j, _, m, _), P = gain(self._noise_no_velocity, belief.P, elapsed)
        dt = 1e-6 * elapsed
        a, b, c, d, e, f = belief.x
        a, b, c = a + dt * d, b + dt * e, c + dt * f
        ya, yb, yc = z[0] - a, z[1] - b, z[2] - c
        squared_offset = ya * ya + yb * yb + yc * yc
        if squared_offset > self._largest_innovation(elapsed) ** 2 or u * squared_offset > self._gate * (
            s * u - t * t
        ):
            return self._refuse_or_restart(belief, time, (*z, d, e, f), self._first_no_velocity)
        x = (a + j * ya, b + j * yb, c + j * yc, d + m * ya, e + m * yb, f + m * yc)
        return Belief(time, x, P, self._turning.prior, (), belief.refused)

    def _refuse_or_restart(self, belief: Belief, time: int, z: Six, first: Square) -> Belief:
        """Refuse ``z``, or restart at it, with covariance ``first``, if enough refused measurements agree."""
        doubts = list(belief.doubts)
        witnesses = 1
        for index, (since, x, earlier) in enumerate(doubts):
            dt = 1e-6 * (time - since)
            off = (z[axis] - x[axis] - dt * x[axis + 3] for axis in range(3))
            if sum(part * part for part in off) <= self._largest_innovation(time - since) ** 2:
                witnesses = earlier + 1
                del doubts[index]
                break
        if witnesses >= self._witnesses:
            return Belief(time, z, first, self._turning.prior, (), belief.refused)
        doubts.append(RefusedMeasurement(time, z, witnesses))
        return replace(belief, doubts=tuple(doubts[-_MAX_HYPOTHESES:]), refused=belief.refused + 1)

    def _largest_innovation(self, elapsed: int) -> float:
        """Return the largest accepted innovation (m and m/s) after ``elapsed`` µs."""
        return self._jump * (1.0 + 1e-6 * elapsed)


@lru_cache(maxsize=64)
def estimator(config: TrackConfig) -> Estimator:
    """Return the estimator shared by all tracks with the same settings."""
    return Estimator(config)
