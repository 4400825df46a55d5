"""State estimation: the output of an estimator such as EKF3 or EKF2.

Position, velocity, attitude and body rates are delayed by some milliseconds and have the errors of the
profile and of GPS faults. Reading the estimate advances nothing: ``advance`` is called on the physics' own
grid, and the errors change on a fixed grid of 100 Hz. With the profile ``truth`` and no fault of GPS, the
estimate is the true state, without any computation of errors.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final, NamedTuple

import numpy as np

from mavlink_bridge.messages import Vector
from sitl.estimation.gps_faults import Positioning
from sitl.estimation.profiles import SensorProfile
from sitl.estimation.random_errors import PERIOD, Errors, RandomErrors
from sitl.values.origin import Origin
from sitl.values.setpoints import ZERO, Pose
from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.multirotor import VehicleState

# Separates these random numbers from those of the vehicle's weather and physics, which have the same seeds.
_RNG_STREAM_ID: Final = 0x53
_NO_ERRORS: Final = Errors(ZERO, ZERO, 0.0, 0.0, 0.0, ZERO)


class Estimate(NamedTuple):
    """Estimated motion.

    Position (m) and velocity (m/s) in the own local NED; Euler angles (rad) of the FRD body relative to it;
    body rates (rad/s, FRD).
    """

    position: Vector
    velocity: Vector
    roll: float
    pitch: float
    yaw: float
    body_rates: Vector

    @property
    def pose(self) -> Pose:
        """Position and yaw."""
        return Pose(self.position, self.yaw)


class Deviation(NamedTuple):
    """Estimate minus truth in the site's NED.

    Position (3,) m, velocity (3,) m/s, attitude as a small rotation vector (3,) rad about the site's axes.
    """

    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray


class Sensors:
    """Estimator of one vehicle.

    ``gps``: errors by GPS faults; ``exact``: the estimate is the truth, and ``advance`` need not be called.
    """

    def __init__(
        self,
        profile: SensorProfile,
        origin: Origin,
        state: VehicleState,
        position_timeout: float,
        seed: int,
        system_id: int,
    ) -> None:
        """Start with the true ``state`` at time 0.

        ``position_timeout`` (s): time without GPS after which the position is lost. ``seed`` (≥ 0) and
        ``system_id`` seed the errors.
        """
        random, gaps, losses = (
            np.random.default_rng([seed, system_id, _RNG_STREAM_ID, part]) for part in range(3)
        )
        self._origin = origin
        self._delay = profile.delay
        self._no_random_errors = profile.exact
        self._random_errors = None if profile.exact else RandomErrors(profile, random)
        self._gaps = _Gaps(profile, gaps)
        self.gps = Positioning(position_timeout, PERIOD * 1e-6, losses)
        self._sample = 0
        self._time = 0
        self._past = deque([(0, state)])

    @property
    def exact(self) -> bool:
        """Whether the estimate is the truth."""
        return self._no_random_errors and self.gps.nominal

    @property
    def drift(self) -> Vector:
        """Rate (m/s, local NED) at which the estimated position moves more than its velocity says."""
        return self._errors.drift

    def silent(self, now: int) -> bool:
        """Return whether position messages drop out at ``now`` (µs, never decreasing)."""
        return self._gaps.holds(now)

    def advance(self, time: int, state: VehicleState) -> None:
        """Advance to ``time`` (µs, increasing) with its true ``state``.

        Call this after every move unless ``exact``.
        """
        past = self._past
        past.append((time, state))
        seen = time - self._delay
        while len(past) > 1 and past[1][0] <= seen:
            past.popleft()
        self._time = time
        sample = time // PERIOD
        for _ in range(sample - self._sample):
            self.gps.step()
        self._sample = sample
        if self._random_errors is not None:
            self._random_errors.advance(sample)

    def estimate(self, state: VehicleState) -> Estimate:
        """Return the present estimate; ``state`` is the truth."""
        if self.exact:
            return _in_local_frame(self._origin, state)
        seen, errors, gps = _in_local_frame(self._origin, self._delayed), self._errors, self.gps
        return Estimate(
            _sum(seen.position, errors.position, gps.position),
            _sum(seen.velocity, errors.velocity, gps.velocity),
            seen.roll + errors.roll,
            seen.pitch + errors.pitch,
            math.remainder(seen.yaw + errors.yaw, math.tau),
            _sum(seen.body_rates, errors.body_rates, ZERO),
        )

    def deviation(self, state: VehicleState) -> Deviation:
        """Return the error of the present estimate; ``state`` is the truth.

        The delay affects position and velocity only: attitude control runs on the gyros, at the rate at which
        they are read.
        """
        errors, gps, then = self._errors, self.gps, self._delayed
        w, x, y, z = state.attitude.tolist()
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        c, s = math.cos(yaw), math.sin(yaw)
        position, velocity = self._origin.vectors_to_site(
            (_sum(errors.position, gps.position, ZERO), _sum(errors.velocity, gps.velocity, ZERO))
        )
        return Deviation(
            position + then.position - state.position,
            velocity + then.velocity - state.velocity,
            np.array((c * errors.roll - s * errors.pitch, s * errors.roll + c * errors.pitch, errors.yaw)),
        )

    # Faults of GPS, effective from the next step on

    def lose_gps(self, time: int, state: VehicleState) -> None:
        """Stop GPS; ``state`` is the truth at ``time`` (µs), that of the last move."""
        self._start_history(time, state)
        self.gps.lose()

    def shift_gps(self, offset: Vector, time: int, state: VehicleState) -> None:
        """Set the error of GPS positions to ``offset`` (m, local NED); the rest as for ``lose_gps``."""
        self._start_history(time, state)
        self.gps.shift(offset)

    def _start_history(self, time: int, state: VehicleState) -> None:
        if self.exact:
            self._past = deque([(time, state)])
            self._sample, self._time = time // PERIOD, time

    @property
    def _errors(self) -> Errors:
        return _NO_ERRORS if self._random_errors is None else self._random_errors.errors

    @property
    def _delayed(self) -> VehicleState:
        """True state ``delay`` ago, interpolated linearly; before the first recorded state, that state."""
        time = self._time - self._delay
        before, a = self._past[0]
        if before >= time or len(self._past) == 1:
            return a
        after, b = self._past[1]
        share = (time - before) / (after - before)
        return VehicleState(*(u + share * (v - u) for u, v in zip(a, b, strict=True)))


class _Gaps:
    """Drop-outs of messages, of uniformly distributed length, with exponentially distributed pauses."""

    def __init__(self, profile: SensorProfile, random: np.random.Generator) -> None:
        self._pause = 60e6 / profile.gaps_per_minute if profile.gaps_per_minute else math.inf
        self._lengths = profile.gap_least * 1e6, profile.gap_most * 1e6
        self._random = random
        self._begin = self._end = 0.0
        if self._pause < math.inf:
            self._next()

    def holds(self, now: int) -> bool:
        """Return whether ``now`` (µs, never decreasing) lies in a drop-out."""
        if self._pause == math.inf:
            return False
        while now >= self._end:
            self._next()
        return now >= self._begin

    def _next(self) -> None:
        self._begin = self._end + self._pause * self._random.standard_exponential()
        self._end = self._begin + self._random.uniform(*self._lengths)


def _in_local_frame(origin: Origin, state: VehicleState) -> Estimate:
    """Return a true state in the vehicle's own local frame.

    The tilt between site and local plane (0.16 mrad per km) is neglected in roll and pitch.
    """
    w, x, y, z = state.attitude.tolist()
    p, q, r = state.body_rates.tolist()
    heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) - origin.turn
    return Estimate(
        origin.position_to_local(state.position),
        origin.vector_to_local(state.velocity),
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2.0 * (w * y - x * z)))),
        math.remainder(heading, math.tau),
        (p, q, r),
    )


def _sum(a: Vector, b: Vector, c: Vector) -> Vector:
    return a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2]
