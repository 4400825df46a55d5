"""Home, the place to which the vehicle returns: HOME_POSITION (242)."""

from __future__ import annotations

from mavlink_bridge.messages import HomePosition, Source, Vector
from sitl.values.origin import Origin

_NAN = float("nan")


class Home:
    """Home position.

    ``position`` (m, own local NED) and ``latitude``, ``longitude`` (degrees), ``altitude`` (m above mean sea
    level). Home is at first the origin; the origin stays when home is moved.
    """

    def __init__(self, origin: Origin) -> None:
        self._origin = origin
        self.position: Vector = (0.0, 0.0, 0.0)
        self.latitude, self.longitude, self.altitude = origin.latitude, origin.longitude, origin.altitude

    @property
    def height(self) -> float:
        """Height above the origin (m)."""
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
