"""The only conversions between frames: NED ↔ ENU, geodetic ↔ fleet-local, vehicle-local NED ↔ fleet-local.

The fleet frame is ENU (x east, y north, z up; m), tangent to WGS84 at an explicit origin. ENU yaw counts
counter-clockwise from east, NED yaw clockwise from north: yaw_ned = π/2 − yaw_enu. pymap3d computes the
geodesy. Altitudes are used as given, above mean sea level or above the ellipsoid, as long as the whole fleet
uses the same reference: the height of the geoid is nearly constant across a flying site.
"""

from __future__ import annotations

import math
from functools import cached_property
from zlib import crc32

import numpy as np
import numpy.typing as npt
from pymap3d import Ellipsoid, enu2geodetic
from pymap3d.ecef import enu2uvw, geodetic2ecef, uvw2enu
from pymap3d.rcurve import meridian, transverse

Array = npt.NDArray[np.float64]

Point = tuple[float, float, float]

_WGS84 = Ellipsoid.from_name("wgs84")
_SEMI_MAJOR, _SEMI_MINOR = _WGS84.semimajor_axis, _WGS84.semiminor_axis
_MAX_ITERATIONS = 8
_CONVERGED_M = 1e-6
# Swaps x and y and negates z; the matrix is its own inverse.
_SWAP: Array = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def ned_to_enu(v: npt.ArrayLike) -> Array:
    """Convert vectors (…, 3) from NED to ENU of the same tangent plane."""
    v = np.asarray(v, dtype=np.float64)
    out = np.empty(v.shape)
    out[..., 0] = v[..., 1]
    out[..., 1] = v[..., 0]
    out[..., 2] = -v[..., 2]
    return out


def enu_to_ned(v: npt.ArrayLike) -> Array:
    """Convert vectors (…, 3) from ENU to NED of the same tangent plane."""
    return ned_to_enu(v)


def wrap(angle: float) -> float:
    """Return the same direction (rad) in (−π, π].

    NaN stays NaN. Raises ValueError for an infinity.
    """
    turned = math.remainder(angle, math.tau)
    return turned if turned != -math.pi else math.pi


def yaw_to_ned(yaw_enu: float) -> float:
    """Convert yaw from rad counter-clockwise from east to rad clockwise from north, in (−π, π]."""
    return wrap(math.pi / 2 - yaw_enu)


def yaw_to_enu(yaw_ned: float) -> float:
    """Convert yaw from rad clockwise from north to rad counter-clockwise from east, in (−π, π]."""
    return wrap(math.pi / 2 - yaw_ned)


def _ecef_of_enu(latitude: float, longitude: float) -> Array:
    """Return the rotation (3, 3) with columns east, north, up in earth-centred earth-fixed components."""
    return np.array(enu2uvw(*np.eye(3), latitude, longitude), dtype=np.float64)


class FleetFrame:
    """Frame of all planning: ENU (m), with its origin at (latitude °, longitude °, altitude m) on WGS84."""

    def __init__(self, latitude: float, longitude: float, altitude: float) -> None:
        self.latitude = latitude
        self.longitude = longitude
        self.altitude = altitude
        self._ecef = tuple(float(part) for part in geodetic2ecef(latitude, longitude, altitude, _WGS84))
        self._enu_of_ecef = np.array(uvw2enu(*np.eye(3), latitude, longitude), dtype=np.float64)
        self._enu_of_ecef.flags.writeable = False
        self._axes: list[list[float]] = self._enu_of_ecef.tolist()
        north_radius = float(meridian(latitude, _WGS84)) + altitude
        east_radius = (float(transverse(latitude, _WGS84)) + altitude) * math.cos(math.radians(latitude))
        self._degrees_north, self._degrees_east = (
            math.degrees(1 / north_radius),
            math.degrees(1 / east_radius),
        )

    def to_enu(self, latitude: float, longitude: float, altitude: float) -> Array:
        """Return the position (3,), m, of a point given in degrees and m."""
        return np.array(self.to_east_north_up(latitude, longitude, altitude))

    def to_east_north_up(self, latitude: float, longitude: float, altitude: float) -> Point:
        """Return east, north and up, m, of a point given in degrees and m; NaN for an infinite one.

        It is pymap3d's geodetic2ecef for one point, in floats: every position that is received passes here.
        """
        if not math.isfinite(latitude + longitude):
            return math.nan, math.nan, math.nan
        phi, lam = math.radians(latitude), math.radians(longitude)
        sine, cosine = math.sin(phi), math.cos(phi)
        radius = _SEMI_MAJOR**2 / math.hypot(_SEMI_MAJOR * cosine, _SEMI_MINOR * sine)
        across = (radius + altitude) * cosine
        x = across * math.cos(lam) - self._ecef[0]
        y = across * math.sin(lam) - self._ecef[1]
        z = (radius * (_SEMI_MINOR / _SEMI_MAJOR) ** 2 + altitude) * sine - self._ecef[2]
        east, north, up = self._axes
        return (
            east[0] * x + east[1] * y + east[2] * z,
            north[0] * x + north[1] * y + north[2] * z,
            up[0] * x + up[1] * y + up[2] * z,
        )

    def to_geodetic(self, enu: npt.ArrayLike) -> tuple[float, float, float]:
        """Return latitude °, longitude °, altitude m of a position (3,), m; accurate to 1 µm within 100 km.

        Inverts ``to_enu`` by fixed-point iteration from the origin, at an eighth of the cost of the closed
        form. The closed form takes over where the iteration does not converge (hundreds of kilometres away,
        next to a pole).
        """
        east, north, up = np.asarray(enu, dtype=np.float64).tolist()
        latitude, longitude, altitude = self.latitude, self.longitude, self.altitude
        missing = (east, north, up)
        for _ in range(_MAX_ITERATIONS):
            latitude += missing[1] * self._degrees_north
            longitude += missing[0] * self._degrees_east
            altitude += missing[2]
            x, y, z = self.to_east_north_up(latitude, longitude, altitude)
            missing = (east - x, north - y, up - z)
            if abs(missing[0]) + abs(missing[1]) + abs(missing[2]) < _CONVERGED_M:
                if abs(latitude) > 90:
                    break
                return latitude, math.remainder(longitude, 360.0), altitude
        latitude, longitude, altitude = enu2geodetic(
            east, north, up, self.latitude, self.longitude, self.altitude, _WGS84
        )
        return float(latitude), float(longitude), float(altitude)

    @cached_property
    def checksum(self) -> int:
        """32-bit checksum of the origin, rounded to the steps of the wire: degE7 and mm."""
        origin = round(self.latitude * 1e7), round(self.longitude * 1e7), round(self.altitude * 1e3)
        return crc32(b"".join(part.to_bytes(8, "little", signed=True) for part in origin))

    @property
    def fingerprint(self) -> int:
        """Lowest 8 bits of ``checksum``, for which a plan message has room; one frame in 256 has the same."""
        return self.checksum & 0xFF

    def local(self, latitude: float, longitude: float, altitude: float) -> LocalFrame:
        """Return the local NED frame of a vehicle whose GPS_GLOBAL_ORIGIN is the given point."""
        rotation = self._enu_of_ecef @ _ecef_of_enu(latitude, longitude) @ _SWAP
        return LocalFrame(rotation, self.to_enu(latitude, longitude, altitude))


class LocalFrame:
    """Transform between a vehicle's local NED and the fleet's ENU: p_fleet = R p_ned + t; R (3, 3), t (3,) m.

    Two tangent planes are tilted by 0.16 mrad per km. Yaw is rotated by the part of R about the vertical, so
    that the two directions of conversion are inverse to each other.
    """

    def __init__(self, rotation: Array, origin_fleet: Array) -> None:
        self.rotation = rotation
        self.origin_fleet = origin_fleet
        rotation.flags.writeable = False
        origin_fleet.flags.writeable = False
        between_enu = rotation @ _SWAP
        self._turn = math.atan2(between_enu[1, 0] - between_enu[0, 1], between_enu[0, 0] + between_enu[1, 1])

    def position_to_fleet(self, ned: npt.ArrayLike) -> Array:
        """Convert positions (…, 3), m, from vehicle-local NED to fleet ENU."""
        return np.asarray(ned, dtype=np.float64) @ self.rotation.T + self.origin_fleet

    def velocity_to_fleet(self, ned: npt.ArrayLike) -> Array:
        """Convert free vectors (…, 3), velocities or accelerations, from vehicle-local NED to fleet ENU."""
        return np.asarray(ned, dtype=np.float64) @ self.rotation.T

    def motion_to_fleet(self, position: Point, velocity: Point) -> tuple[Array, Array]:
        """Convert one position (3,), m, and one free vector (3,) from vehicle-local NED to fleet ENU."""
        return self.rotation.dot(position) + self.origin_fleet, self.rotation.dot(velocity)

    def position_to_local(self, enu: npt.ArrayLike) -> Array:
        """Convert positions (…, 3), m, from fleet ENU to vehicle-local NED."""
        return (np.asarray(enu, dtype=np.float64) - self.origin_fleet) @ self.rotation

    def velocity_to_local(self, enu: npt.ArrayLike) -> Array:
        """Convert free vectors (…, 3), velocities or accelerations, from fleet ENU to vehicle-local NED."""
        return np.asarray(enu, dtype=np.float64) @ self.rotation

    def motion_to_local(
        self, position: Array, velocity: Array, acceleration: Array
    ) -> tuple[Point, Point, Point]:
        """Convert a position (3,), m, and two free vectors (3,) from fleet ENU to vehicle-local NED."""
        motion = np.empty((3, 3))
        np.subtract(position, self.origin_fleet, out=motion[0])
        motion[1], motion[2] = velocity, acceleration
        one, two, three = (motion @ self.rotation).tolist()
        return tuple(one), tuple(two), tuple(three)

    def yaw_to_fleet(self, yaw_ned: float) -> float:
        """Convert rad clockwise from local north to rad counter-clockwise from fleet east, in (−π, π]."""
        return wrap(math.pi / 2 - yaw_ned + self._turn)

    def yaw_to_local(self, yaw_enu: float) -> float:
        """Convert rad counter-clockwise from fleet east to rad clockwise from local north, in (−π, π]."""
        return wrap(math.pi / 2 - yaw_enu + self._turn)
