"""Track of one sender: dated by the sender's clock, filtered, gated, and extrapolated for a bounded time.

``sender_clock`` dates a measurement, ``out_of_sequence`` inserts it in time order, ``estimator`` computes the
filter state.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from companion.config.estimation import TrackConfig
from companion.estimation.estimator import Belief, Measured, Six, Three, estimator
from companion.estimation.kalman_gains import model
from companion.estimation.out_of_sequence import OutOfSequenceBuffer
from companion.estimation.sender_clock import SenderClock
from companion.estimation.turn_rate import Path, turning_path
from companion.values.horizon import Array

_MAX_DISTANCE_M, _MAX_SPEED_M_S = 1e5, 100.0
"""A measurement beyond either limit is rejected as implausible."""
_EARLY_US = 50_000
"""A stamp so much (µs) after a message's arrival is from the future: clocks are known better than that."""


class State(NamedTuple):
    """Position (3,) m and velocity (3,) m/s, fleet-local ENU.

    ``age`` (µs) is the time since the last accepted measurement was true. ``sigma`` (m) is the standard
    deviation of the position on each axis; it grows with the age without bound and is infinite where it is
    unknown. ``turn_rate`` (rad/s) is the rate of change of the course, counter-clockwise seen from above.
    """

    position: Array
    velocity: Array
    age: int
    sigma: float = math.inf
    turn_rate: float = 0.0

    def ahead(self, seconds: Array) -> Path:
        """Return position and velocity ``seconds`` (n,) later, at constant speed and turn rate."""
        return turning_path(self.position, self.velocity, self.turn_rate, seconds)


class Track:
    """Filter of the measurements of one sender; times are the companion's own, in µs.

    ``belief``: filter state after the last measurement; ``time``: when the last accepted measurement was
    true, µs. Both are None before the first; do not change them.
    """

    __slots__ = (
        "_clock",
        "_config",
        "_implausible",
        "_rewind",
        "_undated",
        "belief",
        "time",
    )

    def __init__(self, config: TrackConfig) -> None:
        self._config = config
        self._clock = SenderClock(config.delay_us, config.rewind_us)
        self._rewind = OutOfSequenceBuffer(estimator(config), config.rewind_us)
        self._implausible = self._undated = 0
        self.belief: Belief | None = None
        self.time: int | None = None

    @property
    def brief(self) -> bool:
        """Whether the sender's clock is a simulation's clock, see ``SenderClock``."""
        return self._clock.brief

    @brief.setter
    def brief(self, value: bool) -> None:
        self._clock.brief = value

    @property
    def rejected(self) -> int:
        """Number of discarded measurements: implausible, not datable, too late, or refused by the gate."""
        return self._implausible + self._undated + self._rewind.too_late + self.refused

    @property
    def refused(self) -> int:
        """Number of measurements that the gate refused."""
        return 0 if self.belief is None else self.belief.refused

    @property
    def doubted(self) -> bool:
        """Whether recent measurements contradict the current state (a hypothesis beside it is pending)."""
        return self.belief is not None and bool(self.belief.doubts)

    @property
    def clock_steps(self) -> int:
        """Number of times that the sender's clock was synchronised again after the first time."""
        return max(0, self._clock.laid - 1)

    def measure(self, received: int, position: Array, velocity: Array | None, stamp: int = 0) -> bool:
        """Add a measurement that arrived at ``received`` (µs); return whether it was accepted.

        ``stamp`` is the sender's clock (µs) at sending, 0 for none. Position (3,) m and velocity (3,) m/s or
        None are fleet-local ENU as in the message: for senders with a reversed vertical speed
        (``velocity_up``) the sign is corrected here. A measurement that is at most ``rewind_us`` older than
        the latest is inserted in time order. A duplicate with a stamp does not change the state.
        """
        place, speed = position.tolist(), None if velocity is None else velocity.tolist()
        return self.take(received, measured(place, speed, upward=self._config.velocity_up), stamp)

    def take(self, received: int, z: Measured | None, stamp: int) -> bool:
        """Add a measurement that ``measured`` has converted; return whether it was accepted."""
        if z is None:
            self._implausible += 1
            return False
        dated = self._clock.date(received, stamp if self._config.stamps else 0)
        if dated is None:
            self._undated += 1
            return False
        rewind = self._rewind
        accepted = rewind.put(dated, z)
        self.belief = belief = rewind.belief
        if belief is not None:
            self.time = belief.time + self._clock.skew
        return accepted

    @property
    def late(self) -> int:
        """Delay (µs) of the fastest of the last few messages beyond what clock and link explain.

        The cause is a link that became slow or a clock that stood still.
        """
        return self._clock.late

    @property
    def clock_lost(self) -> int:
        """Time (µs) that the sender's clock has lost, according to its answers (``answered``)."""
        return self._clock.lost

    def answered(self, received: int, asked: int, stamp: int) -> None:
        """Record that the sender's clock showed ``stamp`` between ``asked`` and ``received``.

        ``asked`` and ``received`` are on the own clock; all µs.
        """
        if self._config.stamps:
            self._clock.answered(received, asked, stamp)
            if self.belief is not None:
                self.time = self.belief.time + self._clock.skew

    def when(self, received: int, stamp: int) -> int:
        """Return when the content of another message of the same sender was true, µs.

        The message arrived at ``received`` (own clock) with ``stamp`` (sender's clock, 0 for none), both µs.
        """
        return self._clock.reads(received, stamp if self._config.stamps else 0)

    def dated(self, received: int, stamp: int) -> int | None:
        """Return what ``when`` does, or None for a stamp from the future."""
        used = stamp if self._config.stamps else 0
        return None if self._clock.ahead(received, used) > _EARLY_US else self._clock.reads(received, used)

    def at(self, now: int) -> State | None:
        """Return the state extrapolated to ``now`` (µs), or None before the first measurement.

        Extrapolation ends after ``extrapolate_us``; from then on the state stays there at rest. Before the
        last accepted measurement the result is the state at this measurement, with a negative age.
        """
        belief, time = self.belief, self.time
        if belief is None or time is None:
            return None
        age = now - time
        longest = self._config.extrapolate_us
        dt = 1e-6 * (longest if age > longest else age if age > 0 else 0)
        a, b, c, d, e, f = belief.x
        rate, sigma = belief.turn[0], self._sigma(belief, age)
        if rate == 0.0:
            position, velocity = np.array((a + dt * d, b + dt * e, c + dt * f)), np.array((d, e, f))
        else:
            path = turning_path(np.array((a, b, c)), np.array((d, e, f)), rate, np.array((dt,)))
            position, velocity = path.positions[0], path.velocities[0]
        if age > longest:
            return State(position, np.zeros(3), age, sigma)
        return State(position, velocity, age, sigma, rate)

    @property
    def last(self) -> Six:
        """Filtered position (m) and velocity (m/s) at the last accepted measurement.

        Raises ValueError before the first.
        """
        return self._known_belief().x

    def covariance(self, now: int | None = None) -> Array:
        """Return the covariance (6, 6) of position and velocity at ``now`` (µs).

        Without ``now`` it is that of the last accepted measurement. Raises ValueError before the first one.
        """
        belief = self._known_belief()
        P = np.array(belief.P).reshape(2, 2)
        age = 0 if now is None else now - self._clock.skew - belief.time
        if age > 0:
            F, Q = model(age, self._config.sigma_acceleration)
            P = F @ P @ F.T + Q
        return np.asarray(np.kron(P, np.eye(3)), dtype=np.float64)

    def _sigma(self, belief: Belief, age: int) -> float:
        """Return σ (m) of the position on each axis, ``age`` µs after the state."""
        p, c, _, v = belief.P
        dt = 1e-6 * age if age > 0 else 0.0
        grown = self._config.sigma_acceleration**2 * dt**3 / 3.0
        return math.sqrt(p + dt * (2.0 * c + dt * v) + grown)

    def _known_belief(self) -> Belief:
        if self.belief is None:
            raise ValueError("nothing has been heard yet: there is no state")
        return self.belief


def measured(position: Three, velocity: Three | None, *, upward: bool) -> Measured | None:
    """Return the measurement of a position (m) and a velocity (m/s) or None, fleet-local ENU.

    Returns None for implausible values. ``upward``: the sender reports the vertical speed with the wrong
    sign.
    """
    a, b, c = position
    if velocity is None:
        return (a, b, c) if a * a + b * b + c * c <= _MAX_DISTANCE_M**2 else None
    d, e, f = velocity
    if not (a * a + b * b + c * c <= _MAX_DISTANCE_M**2 and d * d + e * e + f * f <= _MAX_SPEED_M_S**2):
        return None
    return a, b, c, d, e, -f if upward else f
