"""Pose of a vehicle's own local frame in the site frame, the NED frame in which all vehicles move.

site NED: the axes of the site's ``FleetFrame`` (ENU) in the order north, east, down, with the same origin;
local NED: NED at the vehicle's own GPS_GLOBAL_ORIGIN.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mavlink_bridge.frames import FleetFrame, enu_to_ned, ned_to_enu, yaw_to_ned
from mavlink_bridge.messages import Vector

Array = npt.NDArray[np.float64]


class Origin:
    """Origin rounded to whole degE7 and mm, so that the transmitted GPS_GLOBAL_ORIGIN (49) is exact.

    p_site = R p_local + t: ``rotation`` R (3, 3), ``position`` t (3,) m, site NED. ``turn`` (rad): yaw of the
    local north in site NED. ``site``: frame of the site (ENU).
    """

    def __init__(self, site: FleetFrame, latitude: float, longitude: float, altitude: float) -> None:
        self.latitude = round(latitude * 1e7) / 1e7
        self.longitude = round(longitude * 1e7) / 1e7
        self.altitude = round(altitude * 1e3) / 1e3
        self.site = site
        frame = site.local(self.latitude, self.longitude, self.altitude)
        # Row i of ``axes`` is the local axis i in site NED. ``axes`` = Rᵀ transforms row vectors: v @ axes.
        axes = enu_to_ned(frame.velocity_to_fleet(np.eye(3)))
        axes.flags.writeable = False
        self._axes = axes
        self.rotation = axes.T
        self.position = enu_to_ned(frame.origin_fleet)
        self.position.flags.writeable = False
        self.turn = yaw_to_ned(frame.yaw_to_fleet(0.0))

    def motion_to_site(self, motion: npt.ArrayLike) -> Array:
        """Transform rows (n ≥ 1, 3), local NED → site NED: row 0 is a position (m), others free vectors."""
        moved: Array = np.array(motion).dot(self._axes)
        moved[0] += self.position
        return moved

    def vectors_to_site(self, vectors: npt.ArrayLike) -> Array:
        """Transform free vectors (n, 3): local NED → site NED."""
        turned: Array = np.array(vectors).dot(self._axes)
        return turned

    def position_to_local(self, site: Array) -> Vector:
        """Transform a position (3,), m: site NED → local NED."""
        x, y, z = (site - self.position).dot(self.rotation).tolist()
        return x, y, z

    def vector_to_local(self, site: Array) -> Vector:
        """Transform a velocity or acceleration (3,): site NED → local NED."""
        x, y, z = site.dot(self.rotation).tolist()
        return x, y, z

    def local(self, latitude: float, longitude: float, altitude: float) -> Vector:
        """Return the position (m, local NED) of a place (deg, deg, m)."""
        return self.position_to_local(enu_to_ned(self.site.to_enu(latitude, longitude, altitude)))

    def geodetic(self, local: Vector) -> tuple[float, float, float]:
        """Return latitude (deg), longitude (deg), altitude (m) of a position (m, local NED)."""
        return self.site.to_geodetic(ned_to_enu(self.motion_to_site([local])[0]))
