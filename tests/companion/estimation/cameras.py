"""Synthetic cameras: vehicles with errors of their own that last, and detections with independent ones."""

from __future__ import annotations

from math import atan2, hypot, radians

import numpy as np
from scipy.linalg import expm

from companion.config.target_source import FusedSource, OwnErrors
from companion.estimation.detections import Detection, detection
from companion.estimation.fusion_motion import WHITE_SHARE
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CameraTrackingGeo, Source
from outrider.scenarios.companion_settings import own_errors
from sitl.estimation.profiles import PROFILES, ProfileName

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
START = 1_767_225_600_000_000
ALONG, ACROSS_DEG = 0.08, 0.12
"""σ along the ray as a share of the distance, and across it, sideways."""
HEIGHT = 1.8
"""m, of the target."""


def source_of(profile: ProfileName, acceleration: float = 1.0) -> FusedSource:
    return FusedSource(
        kind="fused", own_errors=own_errors(PROFILES[profile]), sigma_acceleration=acceleration
    )


def taller(ray) -> float:
    """σ up and down, relative to that sideways, of an object that stands where ``ray`` (3,), m, ends."""
    distance = float(np.linalg.norm(ray))
    top = max(distance + HEIGHT * ray[2] / distance, 0.5 * distance)
    return (distance + top) / (2.0 * top)


def message(system: int, place, camera, along: float | None = None) -> CameraTrackingGeo:
    """CAMERA_TRACKING_GEO_STATUS of a place, with the accuracies that the SITL's camera would state."""
    ray = np.asarray(place, dtype=float) - camera
    distance = float(np.linalg.norm(ray))
    level = hypot(ray[0], ray[1])
    along = ALONG * distance if along is None else along
    across = radians(ACROSS_DEG) * distance
    cos, sin = level / distance, abs(ray[2]) / distance
    upward = across * taller(ray)
    return CameraTrackingGeo(
        Source(system, 100),
        1,
        *FLEET.to_geodetic(np.asarray(place, dtype=float)),
        None,
        horizontal_accuracy=hypot(hypot(along * cos, upward * sin), across),
        vertical_accuracy=hypot(along * sin, upward * cos),
        distance=distance,
        heading=atan2(ray[0], ray[1]),
        heading_accuracy=across / level,
    )


class Process:
    """First-order Gauss–Markov process of ``size`` numbers with standard deviations ``sigma``."""

    def __init__(self, random: np.random.Generator, sigma, seconds: float) -> None:
        self._random, self._sigma, self._seconds = random, np.asarray(sigma, dtype=float), seconds
        self.value = self._sigma * random.normal(size=self._sigma.shape)

    def step(self, dt: float) -> None:
        keep = np.exp(-dt / self._seconds)
        noise = self._random.normal(size=self._sigma.shape)
        self.value = keep * self.value + np.sqrt(1.0 - keep**2) * self._sigma * noise


class Vehicle:
    """Camera of ``system`` that circles a point at 6 m and 5 m above it."""

    def __init__(self, system: int, bearing: float, source: FusedSource, random: np.random.Generator) -> None:
        errors: OwnErrors = source.errors
        self.system, self._bearing, self._source, self._random = system, bearing, source, random
        horizontal, vertical = errors.sigma_horizontal, errors.sigma_vertical
        self._position = Process(random, [horizontal, horizontal, vertical], errors.position_s)
        self._yaw = Process(random, radians(errors.sigma_yaw_deg), errors.yaw_s)
        self._tilt = Process(random, radians(errors.sigma_tilt_deg), errors.tilt_s)
        (self._late,) = random.spawn(1)

    def step(self, dt: float) -> None:
        for process in (self._position, self._yaw, self._tilt):
            process.step(dt)

    def sees(self, time: int, target, velocity=(0.0, 0.0, 0.0)) -> Detection:
        """What it detects of a target (3,), m, with a velocity (3,), m/s, in an image of about then."""
        late = 1e-6 * self._source.errors.sigma_image_us * self._late.normal()
        target = np.asarray(target) - late * np.asarray(velocity)
        camera = np.array([6.0 * np.cos(self._bearing), 6.0 * np.sin(self._bearing), 5.0])
        ray = np.asarray(target) - camera
        distance = float(np.linalg.norm(ray))
        level = hypot(ray[0], ray[1])
        normal = self._random.normal(size=3)
        across = radians(ACROSS_DEG)
        heading = atan2(ray[1], ray[0]) + across * normal[0] * distance / level + float(self._yaw.value)
        elevation = atan2(ray[2], level) + across * taller(ray) * normal[1] + float(self._tilt.value)
        measured = distance * (1.0 + ALONG * normal[2])
        seen = measured * np.array(
            [np.cos(elevation) * np.cos(heading), np.cos(elevation) * np.sin(heading), np.sin(elevation)]
        )
        believed = (
            camera + self._position.value + self._source.errors.sigma_white * self._random.normal(size=3)
        )
        found = detection(
            self._source,
            self.system,
            time,
            believed + seen,
            believed,
            message(self.system, believed + seen, believed),
        )
        assert found is not None
        return found


class Walker:
    """Target with the motion that the filter assumes: each axis an exponentially correlated acceleration."""

    def __init__(self, random: np.random.Generator, source: FusedSource) -> None:
        self._random, self._rate = random, 1.0 / source.acceleration_s
        self._sigmas = np.array([source.sigma_acceleration] * 2 + [source.sigma_climb])
        self.place, self.velocity = np.zeros(3), random.normal(size=3)
        self._acceleration = self._sigmas * random.normal(size=3)

    def step(self, dt: float) -> None:
        F, Q = singer(dt, self._rate)
        before = np.stack([self.place, self.velocity, self._acceleration])
        noise = np.linalg.cholesky(Q) @ self._random.normal(size=(3, 3)) * self._sigmas
        self.place, self.velocity, self._acceleration = F @ before + noise


def singer(dt: float, rate: float):
    """Transition and covariance (3, 3) of position, velocity and acceleration of variance 1, by Van Loan."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -rate]])
    white, driven = WHITE_SHARE * 2.0 / rate, 2.0 * rate
    both = expm(dt * np.block([[-A, np.diag([0.0, white, driven])], [np.zeros((3, 3)), A.T]]))
    F = both[3:, 3:].T
    return F, F @ both[:3, 3:]
