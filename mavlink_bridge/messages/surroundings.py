"""Messages about the surroundings: obstacle distances, air traffic; and values to plot."""

from __future__ import annotations

from math import degrees, isfinite, radians, remainder, tau
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import (
    FULL_CIRCLE_CDEG,
    UNKNOWN_U16,
    Fields,
    ascii_bytes,
    ascii_text,
    degrees_e7,
    on_globe,
)
from mavlink_bridge.messages.source import Source

SECTORS = 72
_NAME = 10
_CALLSIGN = 8
_SECOND = 1_000_000


@message("ADSB_VEHICLE")
class AdsbVehicle(NamedTuple):
    """ADSB_VEHICLE (246): an aircraft that a receiver detected ``age`` (µs, whole seconds) ago.

    Latitude and longitude in degrees; altitude m (``geometric``: by satellite; otherwise by pressure), course
    rad clockwise from north, speed and climb (up) m/s, None if not marked valid. ``address``: ICAO address.
    """

    source: Source
    address: int
    latitude: float
    longitude: float
    altitude: float | None
    geometric: bool
    course: float | None
    speed: float | None
    climb: float | None
    callsign: str
    emitter: int
    age: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> AdsbVehicle | None:
        address, latitude, longitude, altitude, heading, speed, climb, flags, _, kind, name, emitter, age = (
            fields
        )
        if not (flags & mavlink.ADSB_FLAGS_VALID_COORDS and on_globe(latitude, longitude)):
            return None
        return AdsbVehicle(
            source,
            address,
            latitude / 1e7,
            longitude / 1e7,
            altitude / 1e3 if flags & mavlink.ADSB_FLAGS_VALID_ALTITUDE else None,
            kind == mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC,
            remainder(radians(heading / 100), tau)
            if flags & mavlink.ADSB_FLAGS_VALID_HEADING and heading <= FULL_CIRCLE_CDEG
            else None,
            speed / 1e2 if flags & mavlink.ADSB_FLAGS_VALID_VELOCITY else None,
            climb / 1e2 if flags & mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID else None,
            ascii_text(name[:_CALLSIGN]) if flags & mavlink.ADSB_FLAGS_VALID_CALLSIGN else "",
            emitter,
            age * _SECOND,
        )

    def encode(self) -> Fields:
        known = (
            (mavlink.ADSB_FLAGS_VALID_ALTITUDE, self.altitude is not None),
            (mavlink.ADSB_FLAGS_VALID_HEADING, self.course is not None),
            (mavlink.ADSB_FLAGS_VALID_VELOCITY, self.speed is not None),
            (mavlink.ADSB_FLAGS_VALID_CALLSIGN, bool(self.callsign)),
            (mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID, self.climb is not None),
        )
        return (
            self.address,
            *degrees_e7(self.latitude, self.longitude),
            round((self.altitude or 0.0) * 1e3),
            round(degrees(self.course or 0.0) * 100) % FULL_CIRCLE_CDEG,
            round((self.speed or 0.0) * 1e2),
            round((self.climb or 0.0) * 1e2),
            mavlink.ADSB_FLAGS_VALID_COORDS | sum(bit for bit, valid in known if valid),
            0,
            int(self.geometric),
            ascii_bytes("ADSB_VEHICLE: callsign", self.callsign, _CALLSIGN),
            self.emitter,
            self.age // _SECOND,
        )


@message("NAMED_VALUE_FLOAT")
class NamedValue(NamedTuple):
    """NAMED_VALUE_FLOAT (251): a value for a ground station to plot; ``name`` of at most 10 characters."""

    source: Source
    time_boot: int
    name: str
    value: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> NamedValue | None:
        time, value, name = fields
        return NamedValue(source, time * 1000, ascii_text(name), value) if isfinite(value) else None

    def encode(self) -> Fields:
        if not isfinite(self.value):
            raise EncodeError(f"NAMED_VALUE_FLOAT: value = {self.value} is not finite")
        return self.time_boot // 1000, self.value, ascii_bytes("NAMED_VALUE_FLOAT: name", self.name, _NAME)


@message("OBSTACLE_DISTANCE", finite=True)
class ObstacleDistance(NamedTuple):
    """OBSTACLE_DISTANCE (330): distance (m) of the nearest obstacle in each of 72 sectors.

    A distance is None if unknown, and more than ``max_distance`` if the sector is free.

    The middle of sector k is at ``offset + k·increment`` (rad, clockwise seen from above) from north, or from
    the nose if ``frame`` is MAV_FRAME_BODY_FRD (12). ``time``: µs, on the sender's clock.
    """

    source: Source
    time: int
    sensor: int
    distances: tuple[float | None, ...]
    increment: float
    min_distance: float
    max_distance: float
    offset: float
    frame: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> ObstacleDistance:
        time, distances = fields[0], fields[1 : 1 + SECTORS]
        least, most, sensor, whole, increment, offset, frame = fields[1 + SECTORS :]
        return ObstacleDistance(
            source,
            time,
            sensor,
            tuple(None if distance == UNKNOWN_U16 else distance / 1e2 for distance in distances),
            radians(increment or whole),
            least / 1e2,
            most / 1e2,
            radians(offset),
            frame,
        )

    def encode(self) -> Fields:
        if len(self.distances) != SECTORS:
            raise EncodeError(f"OBSTACLE_DISTANCE: {len(self.distances)} distances; allowed: {SECTORS}")
        return (
            self.time,
            *(UNKNOWN_U16 if distance is None else round(distance * 1e2) for distance in self.distances),
            round(self.min_distance * 1e2),
            round(self.max_distance * 1e2),
            self.sensor,
            0,
            degrees(self.increment),
            degrees(self.offset),
            self.frame,
        )
