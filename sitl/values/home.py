"""Home, the place to which the vehicle returns: HOME_POSITION (242), and the frames of altitudes."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import HomePosition, Source, Vector
from sitl.values.origin import Origin

ABOVE_SEA: Final = frozenset((mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT))
"""Frames whose altitude is above mean sea level."""
ABOVE_HOME: Final = frozenset(
    (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
)
"""Frames whose altitude is above home."""
NOWHERE: Final = 0x7FFFFFFF
"""INT32_MAX as latitude or longitude: the vehicle's position, or "unchanged"."""
_NAN = float("nan")


class Home:
    """Home position.

    ``position`` (m, own local NED), ``latitude``, ``longitude`` (degrees), ``altitude`` (m above mean sea
    level). Home is initially at the origin; moving home does not move the origin.
    """

    def __init__(self, origin: Origin) -> None:
        self._origin = origin
        self.position: Vector = (0.0, 0.0, 0.0)
        self.latitude, self.longitude, self.altitude = origin.latitude, origin.longitude, origin.altitude

    @property
    def height(self) -> float:
        """Height of home above the origin (m)."""
        return self.altitude - self._origin.altitude

    def move(self, latitude: float, longitude: float, altitude: float) -> None:
        """Move home to a place on the globe (degrees, m above mean sea level)."""
        self.latitude, self.longitude, self.altitude = latitude, longitude, altitude
        self.position = self._origin.local(latitude, longitude, altitude)

    def report(self, source: Source, time: int) -> HomePosition:
        """Return HOME_POSITION at ``time`` (µs since boot)."""
        place = self.latitude, self.longitude, self.altitude
        unknown = (_NAN, _NAN, _NAN)
        return HomePosition(source, *place, self.position, (_NAN, *unknown), unknown, time)
