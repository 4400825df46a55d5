"""Messages of fixed places: origin of the local frame, home."""

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
        if not on_globe(fields[0], fields[1]):
            return None
        return HomePosition(
            source,
            fields[0] / 1e7,
            fields[1] / 1e7,
            fields[2] / 1e3,
            fields[3:6],
            fields[6:10],
            fields[10:13],
            fields[13],
        )

    def encode(self) -> Fields:
        place = (
            *degrees_e7(self.latitude, self.longitude),
            round(self.altitude * 1e3),
        )
        return (*place, *self.position_ned, *self.attitude, *self.approach, self.time)


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
        if not on_globe(fields[0], fields[1]):
            return None
        return SetHomePosition(
            source,
            fields[0] / 1e7,
            fields[1] / 1e7,
            fields[2] / 1e3,
            fields[3:6],
            fields[6:10],
            fields[10:13],
            fields[13],
            fields[14],
        )

    def encode(self) -> Fields:
        place = (
            *degrees_e7(self.latitude, self.longitude),
            round(self.altitude * 1e3),
        )
        return (*place, *self.position_ned, *self.attitude, *self.approach, self.target_system, self.time)
