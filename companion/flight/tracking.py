"""Tracking of set-points by the vehicle: the error, and a compensation for what the autopilot lacks.

An autopilot's position loop compensates drag and wind only by its integral, which takes seconds. Meanwhile
the vehicle is beside its plan: 1.8 m at 3 m/s for a PX4 whose simulated airframe has a drag of 1 N per m/s
and kg. A disturbance observer detects the cause of that error early: it predicts the velocity from the
acceleration that the autopilot is known to ask for,

    a_model = a_r + c + k_v (ė + k_p e),   e = p_r − p,

with the reference (p_r, v_r, a_r), the compensation c that was sent and the gains k_p, k_v of the firmware's
own loops, delayed by the lag of its attitude loop. ArduPilot does not follow the set-point itself but a
trajectory that follows the set-point with bounded jerk: there (p_r, v_r, a_r + c) are that trajectory's,
which is predicted as well. The difference of the measured velocity is caused by the disturbance d = κ v + w.
κ, the drag per speed, is learnt from how d changes with the velocity (a Kalman filter of one state); w is the
rest. The compensation κ v_r + ρ w is added to the set-point's acceleration. ρ < 1 lets the part decay to
which the vehicle does not respond; κ v_r is no feedback and needs no such factor.

PX4's position loop is proportional. An offset b of the estimated velocity, as GNSS causes for seconds, leaves
the vehicle b/k_p beside its set-point for as long. b is the estimated velocity minus the rate of change of
the estimated position; it is added to the velocity set-point. That loop is slow, so ``pull`` times e is
added, too. The attitude is late, so a_r is the plan's acceleration ``lead_us`` later. (An integral of the
error was tried: b changes within three seconds, and an integral as fast as that is not stable.)
"""

from __future__ import annotations

from math import exp, inf, sqrt

import numpy as np

from companion.config.flight import TrackingConfig
from companion.flight.autopilots import Loop, Shaping
from companion.values.horizon import Array, Motion

_SHARE = 0.9
"""ρ, the share of the rest w that is compensated."""
_SLOW = 3.0
"""s: time constant of the means with which velocity and disturbance are compared to learn κ."""
_DOUBT, _DRIFT, _NOISE = 1.0, 0.002, 0.2
"""For κ: initial variance (1/s²), its growth (1/s³), spectral density of the noise of d (m²/s³)."""
_MOST_BIAS, _MOST_SURPRISE = 1.0, 2.0
"""m/s: largest velocity offset, and largest contribution of one observation to it.

The second bound is for positions that jump, which are no velocity.
"""
_MOST_PULL = 0.5
"""m/s: largest correction of the position."""
_MOST_DRAG = 2.0
"""1/s: largest drag κ."""
_LONGEST = 0.1
"""s between two observations; after a longer pause the observer restarts."""
_CELL, _CELLS = 0.01, 501
"""Width (m) and number of the cells; the last cell holds all larger errors."""
_FORGET = 10.0
"""s in which the envelope of the error decays to 1/e."""


class Errors:
    """Distribution of errors in little memory: cells of 1 cm up to 5 m."""

    def __init__(self) -> None:
        self._cells = np.zeros(_CELLS, dtype=np.int64)
        self.worst = 0.0

    def add(self, error: float) -> None:
        """Add an ``error`` (m)."""
        self._cells[min(int(error / _CELL), _CELLS - 1)] += 1
        self.worst = max(self.worst, error)

    def percentile(self, share: float) -> float | None:
        """Return the error (m) that ``share`` (0…1) of them do not exceed; None without any."""
        count = int(self._cells.sum())
        if not count:
            return None
        below = int(np.searchsorted(np.cumsum(self._cells), share * count))
        return min((below + 1) * _CELL, self.worst)


class Tracking:
    """Tracking of one vehicle.

    ``error`` (3,), m: measured minus reference position; ``envelope``, m: its largest recent norm;
    ``compensation`` (3,), m/s², horizontal, and ``bias`` (3,), m/s: additions to the acceleration and to the
    velocity of set-points, fleet-local ENU.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._drag, self._doubt, self._room = 0.0, _DOUBT, inf
        self.errors = Errors()
        """Errors of all observed set-points."""
        self.reset()

    def reset(self) -> None:
        """Reset the observer when nothing is followed; the drag is kept, because it is the vehicle's."""
        self._last: int | None = None
        self.error: Array = np.zeros(3)
        self.envelope = 0.0
        self.compensation: Array = np.zeros(3)
        self.bias: Array = np.zeros(3)
        self._found: Array = np.zeros(3)
        self._velocity: Array = np.zeros(2)
        self._place: Array = np.zeros(3)
        self._rest: Array = np.zeros(2)
        self._asked: Array = np.zeros(2)
        # The autopilot's own trajectory: position and velocity relative to the reference, and its
        # acceleration.
        self._ahead: Array = np.zeros((2, 2))
        self._fed: Array = np.zeros(2)
        self._means: Array = np.zeros((2, 2))

    def forget(self) -> None:
        """Forget the estimated velocity offset and the position correction."""
        self.bias, self._found = np.zeros(3), np.zeros(3)

    def keep(self, acceleration: float) -> None:
        """Limit the sum of reference and compensation to ``acceleration`` (m/s²) from now on."""
        self._room = acceleration

    def lead(self, loop: Loop | None) -> int:
        """Return how far (µs) the acceleration of set-points is ahead of their position and velocity."""
        return loop.lead_us if loop is not None and self._config.compensate else 0

    @property
    def excess(self) -> float:
        """Excess (m) of the recent error over the usual one."""
        usual = self._config.usual
        return 0.0 if usual is None else max(self.envelope - usual, 0.0)

    @property
    def drag(self) -> float:
        """κ, the drag per speed, 1/s."""
        return self._drag

    def observe(self, now: int, reference: Motion, measured: Motion, loop: Loop) -> None:
        """Update with the ``reference`` and ``measured`` motion at ``now`` (µs).

        ``loop``: gains of the vehicle's autopilot.
        """
        self.error = measured.position - reference.position
        size = float(np.sqrt(self.error @ self.error))
        last, self._last = self._last, now
        dt = 0.0 if last is None else (now - last) * 1e-6
        self.envelope = max(size, self.envelope * exp(-dt / _FORGET))
        self.errors.add(size)
        if not self._config.compensate:
            return
        if not 0.0 < dt <= _LONGEST:
            self.forget()
            self._velocity, self._place = measured.velocity[:2].copy(), measured.position.copy()
            self._asked = self._fed = reference.acceleration[:2] + self.compensation[:2]
            self._means = np.stack([self._velocity, self._disturbance(self._velocity)])
            return
        if loop.offset_s > 0.0:
            self._offset(dt, measured, loop.offset_s)
            self.bias = self._found - _limited(loop.pull * self.error, _MOST_PULL)
        self._predict(dt, reference, measured, loop)
        self._learn(dt, measured.velocity[:2])
        self._compensate(dt, reference, loop.slew)

    def _offset(self, dt: float, measured: Motion, seconds: float) -> None:
        """Update the estimated velocity offset, with a time constant of ``seconds``."""
        moved, self._place = measured.position - self._place, measured.position.copy()
        surprise = _limited(measured.velocity - moved / dt, _MOST_SURPRISE)
        found = self._found + (1.0 - exp(-dt / seconds)) * (surprise - self._found)
        self._found = _limited(found, _MOST_BIAS)

    def _disturbance(self, velocity: Array) -> Array:
        total: Array = self._drag * velocity + self._rest
        return total

    def _predict(self, dt: float, reference: Motion, measured: Motion, loop: Loop) -> None:
        """Advance the observer by one step; it has two poles at the bandwidth."""
        config, velocity = self._config, measured.velocity[:2]
        self._shape(dt, reference, loop.shaping)
        place, speed = self._ahead
        slip = (reference.velocity + self.bias - measured.velocity)[:2] + speed
        slip += loop.position * (place - self.error[:2])
        asked = self._fed + loop.velocity * slip
        share = 1.0 - exp(-dt / config.lag) if config.lag > 0.0 else 1.0
        self._asked = self._asked + share * (asked - self._asked)
        pole = config.bandwidth
        surprise = velocity - self._velocity
        expected = self._asked - self._disturbance(velocity) + 2.0 * pole * surprise
        self._velocity = self._velocity + dt * expected
        self._rest = self._rest - dt * pole**2 * surprise

    def _shape(self, dt: float, reference: Motion, shaping: Shaping | None) -> None:
        """Advance the prediction of the autopilot's own trajectory by one step."""
        asked = reference.acceleration[:2] + self.compensation[:2]
        if shaping is None:
            self._fed = asked
            return
        place, speed = self._ahead
        wanted = asked - shaping.velocity * (speed + shaping.position * place)
        self._fed = self._fed + _limited(wanted - self._fed, shaping.jerk * dt)
        speed = speed + dt * (self._fed - reference.acceleration[:2])
        self._ahead = np.stack([place + dt * speed, speed])

    def _learn(self, dt: float, velocity: Array) -> None:
        """Update κ from the deviations of disturbance and velocity from their means of the last seconds."""
        now = np.stack([velocity, self._disturbance(velocity)])
        self._means = self._means + dt / _SLOW * (now - self._means)
        moved, pushed = now - self._means
        self._doubt += _DRIFT * dt
        square = float(moved @ moved)
        gain = self._doubt / (_NOISE / dt + self._doubt * square)
        drag = self._drag + gain * float(moved @ pushed - self._drag * square)
        self._doubt *= 1.0 - gain * square
        drag = min(max(drag, 0.0), _MOST_DRAG)
        # The part that is attributed to drag from now on is removed from the rest.
        self._rest = self._rest + (self._drag - drag) * velocity
        self._drag = drag

    def _compensate(self, dt: float, reference: Motion, slew: float) -> None:
        config = self._config
        # The autopilot is asked for this speed, and the drag is that at this speed.
        speed = reference.velocity + self.bias
        ahead = speed[:2] + config.lag * reference.acceleration[:2]
        wanted = _limited(self._drag * ahead + _SHARE * self._rest, config.most)
        change = _limited(wanted - self.compensation[:2], slew * dt)
        added = _beside(reference.acceleration[:2], self.compensation[:2] + change, self._room)
        self.compensation = np.append(added, 0.0)


def _beside(asked: Array, added: Array, most: float) -> Array:
    """Return ``added`` (2,), scaled so that its sum with ``asked`` (2,) is no larger than ``most``.

    Returns zero if ``asked`` alone is larger.
    """
    together = asked + added
    if float(together @ together) <= most * most:
        return added
    square, along, room = float(added @ added), float(asked @ added), most * most - float(asked @ asked)
    if room <= 0.0:
        return np.zeros(2)
    return added * ((sqrt(along * along + square * room) - along) / square)


def _limited(vector: Array, most: float) -> Array:
    size = sqrt(float(vector @ vector))
    return vector if size <= most else vector * (most / size)
