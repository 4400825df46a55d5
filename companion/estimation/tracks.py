"""One moving thing as seen through its messages: dated by its sender's clock, filtered, gated, and carried on
for a bounded time.

``timing`` says when a measurement was true, ``rewind`` puts it in its place, ``estimator`` makes the belief.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from companion.config.estimation import TrackConfig
from companion.estimation.estimator import Belief, Measured, Six, estimator
from companion.estimation.kalman_gains import model
from companion.estimation.out_of_sequence import OutOfSequenceBuffer
from companion.estimation.sender_clock import SenderClock
from companion.estimation.turn_rate import Path, carried
from companion.values.horizon import Array

_FAR, _FAST = 1e5, 100.0
"""m and m/s; beyond these a state is garbage, soundly framed though it may be."""


class State(NamedTuple):
    """Position (3,), velocity (3,), fleet-local ENU; ``age`` µs since the last accepted measurement was true.

    ``sigma``: standard deviation of the position on each axis, m. It grows with the age without bound, and is
    infinite where nobody says. ``turn_rate``: how fast its course turns, rad/s, counter-clockwise from above.
    """

    position: Array
    velocity: Array
    age: int
    sigma: float = math.inf
    turn_rate: float = 0.0

    def ahead(self, seconds: Array) -> Path:
        """Where it will be, and how fast, at each of ``seconds`` (n,) from then if it goes on so."""
        return carried(self.position, self.velocity, self.turn_rate, seconds)


class Track:
    """Filters the measurements of one sender. Times are the companion's own µs."""

    __slots__ = (
        "_absurd",
        "_clock",
        "_config",
        "_rewind",
        "_undated",
    )

    def __init__(self, config: TrackConfig) -> None:
        self._config = config
        self._clock = SenderClock(config.delay_us, config.rewind_us)
        self._rewind = OutOfSequenceBuffer(estimator(config), config.rewind_us)
        self._absurd = self._undated = 0

    @property
    def brief(self) -> bool:
        """Whether its sender's clock is a simulation's, see ``SenderClock``."""
        return self._clock.brief

    @brief.setter
    def brief(self, value: bool) -> None:
        self._clock.brief = value

    @property
    def time(self) -> int | None:
        """When the last accepted measurement was true, µs; None before the first."""
        belief = self._rewind.belief
        return None if belief is None else belief.time + self._clock.skew

    @property
    def rejected(self) -> int:
        """Measurements that came to nothing: absurd, not to be dated, too late, or refused by the gate."""
        belief = self._rewind.belief
        refused = 0 if belief is None else belief.refused
        return self._absurd + self._undated + self._rewind.too_late + refused

    @property
    def refused(self) -> int:
        """Measurements that the gate refused."""
        belief = self._rewind.belief
        return 0 if belief is None else belief.refused

    @property
    def doubted(self) -> bool:
        """Whether another story than the one that is believed has been told lately."""
        belief = self._rewind.belief
        return belief is not None and bool(belief.doubts)

    @property
    def clock_steps(self) -> int:
        """How often the sender's clock was found to be another."""
        return max(0, self._clock.laid - 1)

    def measure(self, received: int, position: Array, velocity: Array | None, stamp: int = 0) -> bool:
        """Take a measurement that arrived at ``received`` (µs) and left with ``stamp`` (µs of the sender's
        clock, 0 for none); whether it was accepted.

        Position (3,) m, velocity (3,) m/s or None, fleet-local ENU as the message has it: the sign of a
        sender that counts its vertical speed upwards is put right here. A late one is taken in its place as
        long as ``rewind_us`` reaches; a duplicate changes nothing.
        """
        return self.take(received, measured(position, velocity, upward=self._config.velocity_up), stamp)

    def take(self, received: int, z: Measured | None, stamp: int) -> bool:
        """The same for what ``measured`` makes of position and velocity."""
        if z is None:
            self._absurd += 1
            return False
        dated = self._clock.date(received, stamp if self._config.stamps else 0)
        if dated is None:
            self._undated += 1
            return False
        return self._rewind.put(dated, z)

    @property
    def late(self) -> int:
        """By how much (µs) the quickest of the last few messages was later than it should be: of a slow link,
        or of a slow clock."""
        return self._clock.late

    @property
    def clock_lost(self) -> int:
        """What (µs) the sender's clock has lost, by its own ``answered``."""
        return self._clock.lost

    def answered(self, received: int, asked: int, stamp: int) -> None:
        """The sender's clock showed ``stamp`` between ``asked`` and ``received``, both of ours; µs."""
        if self._config.stamps:
            self._clock.answered(received, asked, stamp)

    def when(self, received: int, stamp: int) -> int:
        """When another message of the same sender was true, µs: one that arrived at ``received`` and left
        with ``stamp``."""
        return self._clock.reads(received, stamp if self._config.stamps else 0)

    def at(self, now: int) -> State | None:
        """The state carried to ``now``, at most ``extrapolate_us`` far, where it then rests; None before the
        first measurement."""
        belief = self._rewind.belief
        if belief is None:
            return None
        age = now - self._clock.skew - belief.time
        most = self._config.extrapolate_us
        dt = 1e-6 * min(max(age, 0), most)
        a, b, c, d, e, f = belief.x
        rate, sigma = belief.turn.rate, self._sigma(belief, age)
        if rate == 0.0:
            position, velocity = np.array((a + dt * d, b + dt * e, c + dt * f)), np.array((d, e, f))
        else:
            path = carried(np.array((a, b, c)), np.array((d, e, f)), rate, np.array((dt,)))
            position, velocity = path.positions[0], path.velocities[0]
        if age > most:
            return State(position, np.zeros(3), age, sigma)
        return State(position, velocity, age, sigma, rate)

    @property
    def last(self) -> Six:
        """Position and velocity at the last accepted measurement; ValueError before the first."""
        return self._known().x

    def covariance(self, now: int | None = None) -> Array:
        """Covariance (6, 6) of position and velocity at ``now`` (µs), or at the last measurement; ValueError
        before the first."""
        belief = self._known()
        P = np.array(belief.P).reshape(2, 2)
        age = 0 if now is None else now - self._clock.skew - belief.time
        if age > 0:
            F, Q = model(age, self._config.sigma_acceleration)
            P = F @ P @ F.T + Q
        return np.asarray(np.kron(P, np.eye(3)), dtype=np.float64)

    def _sigma(self, belief: Belief, age: int) -> float:
        p, c, _, v = belief.P
        dt = 1e-6 * max(age, 0)
        grown = self._config.sigma_acceleration**2 * dt**3 / 3.0
        return math.sqrt(p + dt * (2.0 * c + dt * v) + grown)

    def _known(self) -> Belief:
        if self._rewind.belief is None:
            raise ValueError("nothing has been heard yet: there is no state")
        return self._rewind.belief


def measured(position: Array, velocity: Array | None, *, upward: bool) -> Measured | None:
    """A measurement of position (3,) m and velocity (3,) m/s or None, fleet-local ENU; None for an absurd
    one. ``upward``: its sender counts the vertical speed the wrong way."""
    a, b, c = position.tolist()
    if velocity is None:
        return (a, b, c) if a * a + b * b + c * c <= _FAR**2 else None
    d, e, f = velocity.tolist()
    if not (a * a + b * b + c * c <= _FAR**2 and d * d + e * e + f * f <= _FAST**2):
        return None
    return a, b, c, d, e, -f if upward else f
