"""One moving thing as seen through its messages: a filterpy Kalman filter with age, a gate and bounded
extrapolation.

State [p, v] (6,), fleet-local ENU, SI; constant velocity with white acceleration; every measurement is
position and velocity, as GLOBAL_POSITION_INT and LOCAL_POSITION_NED carry both.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter

from companion.config import TrackConfig
from companion.horizon import Array

_WITNESSES = 2
"""Consecutive measurements that agree with each other before a jump is believed."""
_FAR, _FAST = 1e5, 100.0
"""m and m/s; beyond these a state is garbage, soundly framed though it may be."""


class State(NamedTuple):
    """Position (3,), velocity (3,), fleet-local ENU; ``age`` µs since the last accepted measurement was
    true."""

    position: Array
    velocity: Array
    age: int


class Track:
    """Filters the measurements of one sender. Times are the companion's own µs."""

    def __init__(self, config: TrackConfig) -> None:
        self._config = config
        self._filter = KalmanFilter(dim_x=6, dim_z=6)
        self._filter.H = np.eye(6)
        self._filter.R = np.diag([config.sigma_position**2] * 3 + [config.sigma_velocity**2] * 3)
        self._time: int | None = None
        self._doubt: list[Array] = []
        self.rejected = 0

    @property
    def time(self) -> int | None:
        """When the last accepted measurement was true, µs; None before the first."""
        return self._time

    def measure(self, received: int, position: Array, velocity: Array) -> bool:
        """Take a measurement that arrived at ``received`` (µs); whether it was accepted.

        One that lies more than ``jump`` metres from the prediction, or would in a second, needs a second
        witness near it: a teleport of one message is noise, a persistent one is real and starts the track
        anew. Late ones (older than the state) and absurd ones are rejected.
        """
        if not (position @ position <= _FAR**2 and velocity @ velocity <= _FAST**2):
            self.rejected += 1
            return False
        time = received - self._config.delay_us
        z = np.concatenate([position, velocity])
        if self._time is None:
            self._start(time, z)
            return True
        if time < self._time:
            self.rejected += 1
            return False
        off, turn = (z - np.concatenate(self._extrapolate(time))).reshape(2, 3)
        if max(float(off @ off), float(turn @ turn)) > self._config.jump**2:
            return self._witness(time, z)
        self._doubt.clear()
        if time > self._time:
            dt = (time - self._time) * 1e-6
            self._filter.predict(F=_transition(dt), Q=_noise(dt, self._config.sigma_acceleration))
        self._filter.update(z)
        self._time = time
        return True

    def at(self, now: int) -> State | None:
        """The state carried to ``now``, at most ``extrapolate_us`` far, where it then rests; None before the
        first measurement."""
        if self._time is None:
            return None
        position, velocity = self._extrapolate(now)
        return State(position, velocity, now - self._time)

    @property
    def last(self) -> Array:
        """Position and velocity (6,) at the last accepted measurement."""
        state: Array = self._filter.x
        return state

    def covariance(self) -> Array:
        """Covariance (6, 6) at the last measurement."""
        return np.array(self._filter.P)

    def _extrapolate(self, time: int) -> tuple[Array, Array]:
        since = time - (self._time if self._time is not None else time)
        dt = min(max(since, 0), self._config.extrapolate_us) * 1e-6
        x = self._filter.x
        moving = since <= self._config.extrapolate_us
        return x[:3] + dt * x[3:], x[3:].copy() if moving else np.zeros(3)

    def _start(self, time: int, z: Array) -> None:
        self._filter.x = z.copy()
        self._filter.P = np.array(self._filter.R)
        self._time = time
        self._doubt.clear()

    def _witness(self, time: int, z: Array) -> bool:
        self._doubt = [d for d in self._doubt if np.linalg.norm(d[:3] - z[:3]) <= self._config.jump]
        self._doubt.append(z)
        if len(self._doubt) < _WITNESSES:
            self.rejected += 1
            return False
        self._start(time, z)
        return True


@lru_cache(maxsize=512)
def _transition(dt: float) -> Array:
    F = np.eye(6)
    F[:3, 3:] = dt * np.eye(3)
    return F


@lru_cache(maxsize=512)
def _noise(dt: float, sigma: float) -> Array:
    """Q of the white-acceleration model; ``Q_continuous_white_noise`` takes the spectral density σ²·(1 s)."""
    block = Q_continuous_white_noise(dim=2, dt=dt, spectral_density=sigma**2)
    return np.kron(block, np.eye(3))
