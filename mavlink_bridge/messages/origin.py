"""Messages of fixed places: origin of the local frame, home. Altitudes in m above mean sea level."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields, degrees_e7, on_globe
from mavlink_bridge.messages.source import Source, Vector


@message("GPS_GLOBAL_ORIGIN", finite=True, size_v1=12)
class GpsGlobalOrigin(NamedTuple):
    """GPS_GLOBAL_ORIGIN (49): the origin of the sender's local frame."""

    source: Source
    latitude: float
    longitude: float
    altitude: float
    time: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> GpsGlobalOrigin | None:
        latitude, longitude, altitude, time = fields
        if not on_globe(latitude, longitude):
            return None
        return GpsGlobalOrigin(source, latitude / 1e7, longitude / 1e7, altitude / 1e3, time)

    def encode(self) -> Fields:
        return (
            *degrees_e7(self.latitude, self.longitude),
            round(self.altitude * 1e3),
            self.time,
        )


@message("SET_GPS_GLOBAL_ORIGIN", size_v1=13)
class SetGpsGlobalOrigin(NamedTuple):
    """SET_GPS_GLOBAL_ORIGIN (48)."""

    source: Source
    latitude: float
    longitude: float
    altitude: float
    target_system: int
    time: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> SetGpsGlobalOrigin | None:
        latitude, longitude, altitude, system, time = fields
        if not on_globe(latitude, longitude):
            return None
        return SetGpsGlobalOrigin(source, latitude / 1e7, longitude / 1e7, altitude / 1e3, system, time)

    def encode(self) -> Fields:
        return (
            *degrees_e7(self.latitude, self.longitude),
            round(self.altitude * 1e3),
            self.target_system,
            self.time,
        )


@message("HOME_POSITION", size_v1=52)
class HomePosition(NamedTuple):
    """HOME_POSITION (242); ``attitude`` (w, x, y, z) at home and ``approach`` (m) are NaN if unknown."""

    source: Source
    latitude: float
    longitude: float
    altitude: float
    position_ned: Vector
    attitude: tuple[float, float, float, float]
    approach: Vector
    time: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> HomePosition | None:
        place = _home(fields)
        return None if place is None else HomePosition(source, *place, fields[13])

    def encode(self) -> Fields:
        return *_home_fields(self), self.time


@message("SET_HOME_POSITION", size_v1=53)
class SetHomePosition(NamedTuple):
    """SET_HOME_POSITION (243), as ``HomePosition``."""

    source: Source
    latitude: float
    longitude: float
    altitude: float
    position_ned: Vector
    attitude: tuple[float, float, float, float]
    approach: Vector
    target_system: int
    time: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> SetHomePosition | None:
        place = _home(fields)
        return None if place is None else SetHomePosition(source, *place, fields[13], fields[14])

    def encode(self) -> Fields:
        return *_home_fields(self), self.target_system, self.time


def _home(
    fields: Fields,
) -> tuple[float, float, float, Vector, tuple[float, float, float, float], Vector] | None:
    """Return the values that both messages of home share, latitude to approach; None for an invalid place."""
    if not on_globe(fields[0], fields[1]):
        return None
    return fields[0] / 1e7, fields[1] / 1e7, fields[2] / 1e3, fields[3:6], fields[6:10], fields[10:13]


def _home_fields(home: HomePosition | SetHomePosition) -> Fields:
    """Return the fields that both messages of home share: the first thirteen."""
    place = *degrees_e7(home.latitude, home.longitude), round(home.altitude * 1e3)
    return *place, *home.position_ned, *home.attitude, *home.approach
