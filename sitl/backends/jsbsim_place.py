"""Position of JSBSim's Earth relative to the site's NED frame, in which the vehicles of a simulation move."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pymap3d import Ellipsoid
from pymap3d.ecef import enu2uvw, geodetic2ecef

from mavlink_bridge.frames import FleetFrame, ned_to_enu
from sitl.vehicle.airframe import FloatArray

_WGS84 = Ellipsoid.from_name("wgs84")


class Geodetic(NamedTuple):
    """Place on WGS84."""

    latitude: float  # deg
    longitude: float  # deg
    altitude: float  # m above the ellipsoid, which JSBSim takes for sea level


class Place:
    """Site's NED frame on the Earth: x_site = S (x_ecef − o).

    ``axes`` is S (3, 3), ``origin`` o (3,) m, earth-centred, earth-fixed.
    """

    def __init__(self, site: FleetFrame) -> None:
        self._site = site
        self.axes = ned_axes(site.latitude, site.longitude)
        self.origin = np.array(geodetic2ecef(site.latitude, site.longitude, site.altitude, _WGS84))

    def geodetic(self, position: ArrayLike) -> Geodetic:
        """Return the geodetic place of a position (3,) (m, site NED)."""
        # NED ↔ ENU is its own inverse.
        return Geodetic(*self._site.to_geodetic(ned_to_enu(position)))

    def local_axes(self, place: Geodetic) -> FloatArray:
        """Return the rotation (3, 3) from the site's NED to the NED of ``place``."""
        axes: FloatArray = ned_axes(place.latitude, place.longitude) @ self.axes.T
        return axes


def ned_axes(latitude: float, longitude: float) -> FloatArray:
    """Return the rotation (3, 3) from earth-centred, earth-fixed to NED at a latitude and longitude (deg)."""
    # Columns of the east, north and up axes in ECEF.
    enu = np.array(enu2uvw(*np.eye(3), latitude, longitude), dtype=np.float64)
    axes: FloatArray = np.stack((enu[:, 1], enu[:, 0], -enu[:, 2]))
    return axes


def rotation_of(attitude: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) from body to NED of an attitude (4,): w, x, y, z."""
    w, (x, y, z) = attitude[0], attitude[1:]
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: FloatArray = np.eye(3) + 2.0 * (w * skew + skew @ skew)
    return rotation


def euler_angles(rotation: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch, yaw (rad) of a rotation (3, 3) from body (FRD) to NED."""
    return (
        math.atan2(rotation[2, 1], rotation[2, 2]),
        math.asin(max(-1.0, min(1.0, -float(rotation[2, 0])))),
        math.atan2(rotation[1, 0], rotation[0, 0]),
    )
