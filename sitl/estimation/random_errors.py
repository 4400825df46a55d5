"""Random errors of an estimate, per sample of the estimator's clock of 100 Hz.

The slow error of the position is a two-pole Gauss–Markov process, which has a rate of change. The velocity
error contains this rate, consistent with the position error. A filter that pulls its position back to the
measured one moves it against its velocity: e' = v − k e for the errors e and v, so v contains k e, too.
Reading the errors does not advance them.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from mavlink_bridge.messages import Vector
from sitl.environment.noise import one_pole, two_poles
from sitl.estimation.profiles import SensorProfile
from sitl.values.setpoints import ZERO

PERIOD: Final = 10_000
"""Time between samples (µs): the estimators of both firmwares run at 100 Hz."""

_DT: Final = PERIOD * 1e-6
_BLOCK_SAMPLES: Final = 100
_ONE_POLES: Final = 9  # velocity, roll, pitch, yaw, gyro bias
_DRAWS: Final = 6 + _ONE_POLES + 6  # two poles per axis; one poles; white position and rates

Array = npt.NDArray[np.float64]


class Errors(NamedTuple):
    """Estimate minus truth.

    Position (m) and velocity (m/s) in local NED, roll, pitch and yaw (rad), body rates (rad/s, FRD).
    ``drift``: rate (m/s, local NED) at which the position moves more than the velocity says, −k e.
    """

    position: Vector
    velocity: Vector
    roll: float
    pitch: float
    yaw: float
    body_rates: Vector
    drift: Vector = ZERO


class RandomErrors:
    """Errors of one profile from one generator; ``advance`` to a sample, then read ``errors``."""

    def __init__(self, profile: SensorProfile, random: np.random.Generator) -> None:
        """Start in the steady state at the first sample."""
        p = profile
        poles = two_poles(_DT / p.drift_time, _DT / p.drift_onset)
        self._transition = np.array([[poles.f11, poles.f12], [poles.f21, poles.f22]])
        self._noise_gain = np.array([[poles.g11, 0.0], [poles.g21, poles.g22]])
        times = [p.velocity_time] * 3 + [p.tilt_time] * 2 + [p.yaw_time] + [p.rate_bias_time] * 3
        steps = [one_pole(_DT / time) for time in times]
        self._decay = np.array([step.keep for step in steps])
        self._gain = np.array([step.gain for step in steps])
        drift = np.array([p.horizontal_drift, p.horizontal_drift, p.vertical_drift])
        self._drift = drift
        self._speed = drift / np.sqrt(p.drift_time * p.drift_onset)
        self._pull = drift * np.array([p.horizontal_pull, p.horizontal_pull, p.vertical_pull])
        self._sizes = np.array([p.velocity] * 3 + [p.tilt] * 2 + [p.yaw] + [p.rate_bias] * 3)
        self._white = np.array([p.position_white] * 3 + [p.rate_white] * 3)
        self._random = random
        self._walks: Array = random.standard_normal((2, 3))
        self._biases: Array = random.standard_normal(_ONE_POLES)
        self._first = 0
        self._rows = self._block()
        self._sample = 0

    def advance(self, sample: int) -> None:
        """Advance to ``sample``, which must not decrease; this is not checked."""
        while sample - self._first >= _BLOCK_SAMPLES:
            self._first += _BLOCK_SAMPLES
            self._rows = self._block()
        self._sample = sample - self._first

    @property
    def errors(self) -> Errors:
        """Errors of the present sample."""
        x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, *drift = self._rows[self._sample].tolist()
        return Errors((x, y, z), (vx, vy, vz), roll, pitch, yaw, (p, q, r), (drift[0], drift[1], drift[2]))

    def _block(self) -> Array:
        """Return the next rows (_BLOCK_SAMPLES, 15) of errors, in the order of the fields of ``Errors``."""
        draws = self._random.standard_normal((_BLOCK_SAMPLES, _DRAWS))
        pole_noise = self._noise_gain @ draws[:, :6].reshape(_BLOCK_SAMPLES, 2, 3)
        bias_noise = self._gain * draws[:, 6 : 6 + _ONE_POLES]
        walks, biases = np.empty((_BLOCK_SAMPLES, 2, 3)), np.empty((_BLOCK_SAMPLES, _ONE_POLES))
        for k in range(_BLOCK_SAMPLES):
            walks[k], biases[k] = self._walks, self._biases
            self._walks = self._transition @ self._walks + pole_noise[k]
            self._biases = self._decay * self._biases + bias_noise[k]
        biases *= self._sizes
        white = self._white * draws[:, -6:]
        pulled = self._pull * walks[:, 0]
        return np.hstack(
            [
                self._drift * walks[:, 0] + white[:, :3],
                self._speed * walks[:, 1] + pulled + biases[:, :3],
                biases[:, 3:6],
                biases[:, 6:] + white[:, 3:],
                -pulled,
            ]
        )
