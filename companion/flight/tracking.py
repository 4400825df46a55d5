"""Tracking of set-points by the vehicle: the tracking error, and compensation of drag and wind.

An autopilot's position loop compensates drag and wind only by its integral, which takes seconds. Meanwhile
the vehicle is beside its plan: 1.8 m at 3 m/s for a PX4 whose simulated airframe has a drag of 1 N per m/s
and kg. A disturbance observer detects the cause of that error early. It predicts the velocity from the
acceleration that the autopilot's control law commands,

    a_model = a_r + c + k_v (ė + b + k_p e),   e = p_r − p,

with the reference (p_r, v_r, a_r), the compensations c and b that were sent and the gains k_p, k_v of the
firmware's loops; a low-pass of time constant ``lag`` stands for the attitude loop. ArduPilot does not follow
the set-point itself but a trajectory that follows the set-point with bounded jerk: then (p_r, v_r, a_r + c)
are replaced by that trajectory, which is predicted as well. The difference between the measured and the
predicted velocity is attributed to the disturbance d = κ v + w, the deceleration by drag and wind. κ, the
drag per speed, is estimated from the correlation of d with the velocity v (a Kalman filter of one state); w
is the residual. The compensation c = κ (v_r + b + lag · a_r) + ρ w is added to the set-point's acceleration.
If the vehicle does not respond to c, the observer takes the missing acceleration for a disturbance, and c
would sustain itself; with ρ < 1 it decays. The drag term follows the reference and needs no such factor; only
b feeds measurements back into it.

PX4's position loop is proportional. An offset of the estimated velocity, as GNSS causes for seconds, puts the
vehicle offset/k_p beside its set-point for as long. The offset is the estimated velocity minus the rate of
change of the estimated position, low-pass filtered. ``bias`` b, which is added to the velocity set-point, is
this offset plus ``pull`` · e, because the position loop alone is slow. The attitude responds late, so a_r is
the plan's acceleration ``lead_us`` later. (An integral of the error was tried: the offset changes within
three seconds, and an integral as fast as that is not stable.)
"""

from __future__ import annotations

from math import exp, inf, sqrt

import numpy as np

from companion.config.flight import TrackingConfig
from companion.flight.autopilots import Loop, Shaping
from companion.values.horizon import Array, Motion

_RESIDUAL_SHARE = 0.9
"""ρ, the share of the residual disturbance w that is compensated."""
_MEAN_TIME_CONSTANT_S = 3.0
"""s: time constant of the running means of velocity and disturbance from which κ is estimated."""
_DRAG_VARIANCE, _DRAG_PROCESS_NOISE, _DISTURBANCE_NOISE = 1.0, 0.002, 0.2
"""For κ: initial variance (1/s²), its growth (1/s³), spectral density of the noise of d (m²/s³)."""
_MAX_OFFSET, _MAX_OFFSET_SAMPLE = 1.0, 2.0
"""m/s: largest estimated velocity offset, and largest single sample at the input of its low-pass.

The second bound limits the effect of a jump of the estimated position, which is no motion.
"""
_MAX_PULL = 0.5
"""m/s: largest velocity that corrects the position error."""
MAX_DRAG = 2.0
"""1/s: largest drag κ."""
_MAX_PERIOD_S = 0.1
"""s between two observations; after a longer pause the prediction restarts, and κ, w and c are kept."""
_BIN_WIDTH, _BIN_COUNT = 0.01, 501
"""Width (m) and number of the histogram bins; the last bin holds all larger errors."""
_ENVELOPE_DECAY_S = 10.0
"""s in which the envelope of the error decays to 1/e."""


NO_ADDITION: Array = np.zeros(3)
"""No addition to the velocity."""
NO_ADDITION.flags.writeable = False


class Errors:
    """Histogram of tracking errors with bins of 1 cm up to 5 m; ``worst``: the largest error, m."""

    def __init__(self) -> None:
        self._counts = np.zeros(_BIN_COUNT, dtype=np.int64)
        self.worst = 0.0

    def add(self, error: float) -> None:
        """Add an ``error`` (m)."""
        self._counts[min(int(error / _BIN_WIDTH), _BIN_COUNT - 1)] += 1
        self.worst = max(self.worst, error)

    def percentile(self, share: float) -> float | None:
        """Return the error (m) that ``share`` (0…1) of the errors do not exceed; None before the first error.

        It is rounded up to 1 cm, but at most ``worst``, and at most 5.01 m even if errors are larger.
        """
        count = int(self._counts.sum())
        if not count:
            return None
        below = int(np.searchsorted(np.cumsum(self._counts), share * count))
        return min((below + 1) * _BIN_WIDTH, self.worst)


class Tracking:
    """Tracking of one vehicle.

    ``error`` (3,), m: measured minus reference position (−e); ``envelope``, m: its largest recent norm;
    ``compensation`` (3,), m/s², horizontal, and ``bias`` (3,), m/s: additions to the acceleration and to the
    velocity of set-points, fleet-local ENU.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._drag, self._drag_variance, self._max_acceleration = 0.0, _DRAG_VARIANCE, inf
        self.errors = Errors()
        """Errors of all observed set-points."""
        self._reset()

    def reset(self) -> None:
        """Reset the observer while no set-points are followed; κ is kept, as a property of the vehicle."""
        if self._last_time is not None:
            self._reset()

    def _reset(self) -> None:
        self._last_time: int | None = None
        self.error: Array = np.zeros(3)
        self.envelope = 0.0
        self.compensation: Array = np.zeros(3)
        self.bias: Array = np.zeros(3)
        self._offset: Array = np.zeros(3)
        self._predicted_velocity: Array = np.zeros(2)
        self._last_position: Array = np.zeros(3)
        self._residual: Array = np.zeros(2)
        self._model_acceleration: Array = np.zeros(2)
        # Integral of the velocity error, where the loop's integral is modelled.
        self._integral: Array = np.zeros(2)
        # Trajectory that the autopilot follows: rows are position and velocity relative to the reference.
        self._relative: Array = np.zeros((2, 2))
        # Acceleration of this trajectory; for an autopilot without one, the acceleration of the set-point.
        self._feedforward: Array = np.zeros(2)
        # Running means; rows are velocity and disturbance.
        self._means: Array = np.zeros((2, 2))

    def forget(self) -> None:
        """Set the estimated velocity offset and ``bias`` to zero."""
        self.bias, self._offset = np.zeros(3), np.zeros(3)

    def keep(self, acceleration: float) -> None:
        """Limit the horizontal sum of reference acceleration and compensation to ``acceleration`` (m/s²).

        The limit holds from the next observation on.
        """
        self._max_acceleration = acceleration

    def lead(self, loop: Loop | None) -> int:
        """Return how far (µs) the acceleration of set-points is ahead of their position and velocity.

        It is 0 without compensation or for an unknown autopilot.
        """
        return loop.lead_us if loop is not None and self._config.compensate else 0

    @property
    def added_velocity(self) -> Array:
        """Addition (3,), m/s, to the velocity of set-points besides ``bias``."""
        return NO_ADDITION

    @property
    def added_acceleration(self) -> Array:
        """Addition (3,), m/s², to the acceleration of set-points."""
        return self.compensation

    @property
    def excess(self) -> float:
        """Excess (m) of ``envelope`` over the configured ``usual`` error; 0 if none is configured."""
        usual = self._config.usual
        return 0.0 if usual is None else max(self.envelope - usual, 0.0)

    @property
    def drag(self) -> float:
        """κ, the drag per speed, 1/s."""
        return self._drag

    def observe(self, now: int, reference: Motion, measured: Motion, loop: Loop) -> None:
        """Update with the ``reference`` and ``measured`` motion at ``now`` (µs), fleet-local ENU.

        The acceleration of ``reference`` is the plan's ``lead`` later, as sent. ``loop``: gains of the
        vehicle's autopilot.
        """
        self.error = measured.position - reference.position
        size = float(np.sqrt(self.error @ self.error))
        last, self._last_time = self._last_time, now
        dt = 0.0 if last is None else (now - last) * 1e-6
        self.envelope = max(size, self.envelope * exp(-dt / _ENVELOPE_DECAY_S))
        self.errors.add(size)
        if not self._config.compensate:
            return
        if not 0.0 < dt <= _MAX_PERIOD_S:
            self.forget()
            self._predicted_velocity = measured.velocity[:2].copy()
            self._last_position = measured.position.copy()
            self._model_acceleration = self._feedforward = reference.acceleration[:2] + self.compensation[:2]
            self._means = np.stack([measured.velocity[:2], self._disturbance(measured.velocity[:2])])
            return
        if loop.offset_s > 0.0:
            self._estimate_offset(dt, measured, loop.offset_s)
            self.bias = self._offset - _limited(loop.pull * self.error, _MAX_PULL)
        self._predict(dt, reference, measured, loop)
        self._estimate_drag(dt, measured.velocity[:2])
        self._compensate(dt, reference, loop.slew)

    def _estimate_offset(self, dt: float, measured: Motion, time_constant: float) -> None:
        """Update the estimated velocity offset with a low-pass of ``time_constant`` (s)."""
        moved, self._last_position = measured.position - self._last_position, measured.position.copy()
        sample = _limited(measured.velocity - moved / dt, _MAX_OFFSET_SAMPLE)
        offset = self._offset + (1.0 - exp(-dt / time_constant)) * (sample - self._offset)
        self._offset = _limited(offset, _MAX_OFFSET)

    def _disturbance(self, velocity: Array) -> Array:
        total: Array = self._drag * velocity + self._residual
        return total

    def _predict(self, dt: float, reference: Motion, measured: Motion, loop: Loop) -> None:
        """Advance the observer by one step; its error dynamics have a double pole at −``bandwidth``."""
        config, velocity = self._config, measured.velocity[:2]
        self._predict_trajectory(dt, reference, loop.shaping)
        position, speed = self._relative
        velocity_error = (reference.velocity + self.bias - measured.velocity)[:2] + speed
        velocity_error += loop.position * (position - self.error[:2])
        commanded = self._feedforward + loop.velocity * velocity_error
        if loop.integral > 0.0:
            self._integral = self._integral + dt * velocity_error
            commanded = commanded + loop.integral * self._integral
        share = 1.0 - exp(-dt / config.lag) if config.lag > 0.0 else 1.0
        self._model_acceleration = self._model_acceleration + share * (commanded - self._model_acceleration)
        pole = config.bandwidth
        innovation = velocity - self._predicted_velocity
        expected = self._model_acceleration - self._disturbance(velocity) + 2.0 * pole * innovation
        self._predicted_velocity = self._predicted_velocity + dt * expected
        self._residual = self._residual - dt * pole**2 * innovation

    def _predict_trajectory(self, dt: float, reference: Motion, shaping: Shaping | None) -> None:
        """Advance the prediction of the trajectory that the autopilot follows by one step."""
        sent = reference.acceleration[:2] + self.compensation[:2]
        if shaping is None:
            self._feedforward = sent
            return
        position, speed = self._relative
        wanted = sent - shaping.velocity * (speed + shaping.position * position)
        self._feedforward = self._feedforward + _limited(wanted - self._feedforward, shaping.jerk * dt)
        speed = speed + dt * (self._feedforward - reference.acceleration[:2])
        self._relative = np.stack([position + dt * speed, speed])

    def _estimate_drag(self, dt: float, velocity: Array) -> None:
        """Update κ from the deviations of disturbance and velocity from their running means."""
        now = np.stack([velocity, self._disturbance(velocity)])
        self._means = self._means + dt / _MEAN_TIME_CONSTANT_S * (now - self._means)
        velocity_change, disturbance_change = now - self._means
        self._drag_variance += _DRAG_PROCESS_NOISE * dt
        square = float(velocity_change @ velocity_change)
        gain = self._drag_variance / (_DISTURBANCE_NOISE / dt + self._drag_variance * square)
        drag = self._drag + gain * float(velocity_change @ disturbance_change - self._drag * square)
        self._drag_variance *= 1.0 - gain * square
        drag = min(max(drag, 0.0), MAX_DRAG)
        # A change of κ moves part of the disturbance from w to the drag: their sum remains the same.
        self._residual = self._residual + (self._drag - drag) * velocity
        self._drag = drag

    def _compensate(self, dt: float, reference: Motion, slew: float) -> None:
        config = self._config
        # The drag is that at the velocity sent to the autopilot, advanced by the lag of the attitude loop.
        speed = reference.velocity + self.bias
        ahead = speed[:2] + config.lag * reference.acceleration[:2]
        wanted = _limited(self._drag * ahead + _RESIDUAL_SHARE * self._residual, config.most)
        change = _limited(wanted - self.compensation[:2], slew * dt)
        planned, compensation = reference.acceleration[:2], self.compensation[:2] + change
        self.compensation = np.append(_scaled_to_fit(planned, compensation, self._max_acceleration), 0.0)


def _scaled_to_fit(planned: Array, added: Array, most: float) -> Array:
    """Return ``added`` (2,), scaled down so that the norm of its sum with ``planned`` (2,) is ≤ ``most``.

    If the sum is too large and the norm of ``planned`` alone is ``most`` or more, returns zero.
    """
    total = planned + added
    if float(total @ total) <= most * most:
        return added
    square, along, left = float(added @ added), float(planned @ added), most * most - float(planned @ planned)
    if left <= 0.0:
        return np.zeros(2)
    return added * ((sqrt(along * along + square * left) - along) / square)


def _limited(vector: Array, most: float) -> Array:
    """Return ``vector``, scaled down to a norm of at most ``most``."""
    size = sqrt(float(vector @ vector))
    return vector if size <= most else vector * (most / size)
