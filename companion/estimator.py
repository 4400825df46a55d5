"""What one measurement makes of a belief: gate, Kalman filter, and the doubts that may become a new belief.

State [p, v] per axis; constant velocity with white acceleration; every measurement is position and velocity,
as GLOBAL_POSITION_INT and LOCAL_POSITION_NED carry both. The three axes have the same model and the same
noise, hence one gain and one covariance P (2, 2): together they are the filter of six states, of covariance
P ⊗ I₃, exactly (``gains``).
"""

from __future__ import annotations

from typing import NamedTuple

from companion.config import TrackConfig
from companion.gains import Noise, Square, gain, prepared
from companion.turning import Turn, TurnFilter

Six = tuple[float, float, float, float, float, float]
"""Position (m) and velocity (m/s), fleet-local ENU. Floats, not arrays: numpy would take longer over six of
them than all the rest of a step."""

_DOUBTS = 4
"""So many stories may be told beside the one that is believed."""


class Doubt(NamedTuple):
    """The last of ``witnesses`` refused measurements that agree with each other, and when it was true, µs."""

    time: int
    z: Six
    witnesses: int


class Belief(NamedTuple):
    """What is known of one sender: the state, the covariance P (2, 2) of each axis, row by row, and how fast
    it turns.

    ``time``: when the last accepted measurement was true, µs; ``refused``: how many were not accepted.
    """

    time: int
    x: Six
    P: Square
    turn: Turn
    doubts: tuple[Doubt, ...]
    refused: int


class Estimator:
    """Steps from belief to belief: a function of its arguments alone."""

    def __init__(self, config: TrackConfig) -> None:
        self._noise = Noise(config.sigma_position, config.sigma_velocity, config.sigma_acceleration)
        prepared(self._noise)
        self._first: Square = (config.sigma_position**2, 0.0, 0.0, config.sigma_velocity**2)
        self._turning = TurnFilter(config.sigma_turn, 1e-6 * config.turn_memory_us, config.sigma_velocity)
        self._gate = config.gate
        self._jump = config.jump
        self._witnesses = config.witnesses

    def after(self, belief: Belief | None, time: int, z: Six) -> Belief:
        """The belief after a measurement ``z`` that was true at ``time`` (µs), no earlier than the belief's.

        It is refused when d² = yᵀS⁻¹y exceeds the gate (χ² of six), or when it lies further from the
        prediction than ``jump`` metres, or would in a second, for every second since the last and one more.
        Refused ones agree when each lies within that distance of where the one before it was going: after
        ``witnesses`` of them the state begins anew with the last. They need not fit the model, or who
        manoeuvres harder than the model thinks would be locked out.
        """
        if belief is None:
            return Belief(time, z, self._first, self._turning.unknown, (), 0)
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
            return self._doubt(belief, time, z)
        x = (
            a + j * ya + k * yd,
            b + j * yb + k * ye,
            c + j * yc + k * yf,
            d + m * ya + n * yd,
            e + m * yb + n * ye,
            f + m * yc + n * yf,
        )
        turn = self._turning.after(belief.turn, dt, (d, e), (x[3], x[4]))
        return Belief(time, x, P, turn, (), belief.refused)

    def _doubt(self, belief: Belief, time: int, z: Six) -> Belief:
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
            return Belief(time, z, self._first, self._turning.unknown, (), belief.refused)
        doubts.append(Doubt(time, z, witnesses))
        return belief._replace(doubts=tuple(doubts[-_DOUBTS:]), refused=belief.refused + 1)

    def _most(self, elapsed: int) -> float:
        return self._jump * (1.0 + 1e-6 * elapsed)
