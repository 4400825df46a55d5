"""Fields of the messages in ``messages.surroundings``."""

from __future__ import annotations

from math import degrees, isfinite, nan, radians, remainder, tau

from mavlink_bridge import messages as m
from mavlink_bridge.errors import EncodeError
from mavlink_bridge.wire.fields.units import FULL_CIRCLE_CDEG, UNKNOWN_U16, Fields, degrees_e7, on_globe

SECTORS = 72
_NAME = 10
_CALLSIGN = 8
_SECOND = 1_000_000
# Bits of ADSB_FLAGS.
_COORDINATES, _ALTITUDE, _HEADING, _VELOCITY, _CALLED, _CLIMB = 0x1, 0x2, 0x4, 0x8, 0x10, 0x80
_GEOMETRIC = 1


def _text(data: bytes) -> str:
    """Decode ASCII; other characters become question marks, as in the encoder."""
    return data.split(b"\0", 1)[0].decode("ascii", errors="replace").replace("\ufffd", "?")


def _bytes(field: str, text: str, most: int) -> bytes:
    data = text.encode("ascii", errors="replace")
    if len(data) > most:
        raise EncodeError(f"{field} = {text!r} is longer than {most} characters")
    return data


def adsb(s: m.Source, f: Fields) -> m.AdsbVehicle | None:
    """Decode ADSB_VEHICLE; return None if a field is invalid."""
    address, latitude, longitude, altitude, heading, speed, climb, flags, _, kind, name, emitter, age = f
    if not (flags & _COORDINATES and on_globe(latitude, longitude)):
        return None
    return m.AdsbVehicle(
        s,
        address,
        latitude / 1e7,
        longitude / 1e7,
        altitude / 1e3 if flags & _ALTITUDE else None,
        kind == _GEOMETRIC,
        remainder(radians(heading / 100), tau) if flags & _HEADING and heading <= FULL_CIRCLE_CDEG else None,
        speed / 1e2 if flags & _VELOCITY else None,
        climb / 1e2 if flags & _CLIMB else None,
        _text(name[:_CALLSIGN]) if flags & _CALLED else "",
        emitter,
        age * _SECOND,
    )


def adsb_fields(x: m.AdsbVehicle) -> Fields:
    """Encode ADSB_VEHICLE; raise EncodeError for a value that does not fit."""
    known = (
        (_ALTITUDE, x.altitude is not None),
        (_HEADING, x.course is not None),
        (_VELOCITY, x.speed is not None),
        (_CALLED, bool(x.callsign)),
        (_CLIMB, x.climb is not None),
    )
    return (
        x.address,
        degrees_e7("latitude", x.latitude, 90),
        degrees_e7("longitude", x.longitude, 180),
        round((x.altitude or 0.0) * 1e3),
        round(degrees(x.course or 0.0) * 100) % FULL_CIRCLE_CDEG,
        round((x.speed or 0.0) * 1e2),
        round((x.climb or 0.0) * 1e2),
        _COORDINATES | sum(bit for bit, valid in known if valid),
        0,
        int(x.geometric),
        _bytes("ADSB_VEHICLE: callsign", x.callsign, _CALLSIGN),
        x.emitter,
        x.age // _SECOND,
    )


def named_value(s: m.Source, f: Fields) -> m.NamedValue | None:
    """Decode NAMED_VALUE_FLOAT; return None if a field is invalid."""
    time, value, name = f
    return m.NamedValue(s, time * 1000, _text(name), value) if isfinite(value) else None


def named_value_fields(x: m.NamedValue) -> Fields:
    """Encode NAMED_VALUE_FLOAT; raise EncodeError for a value that does not fit."""
    if not isfinite(x.value):
        raise EncodeError(f"NAMED_VALUE_FLOAT: value = {x.value} is not finite")
    return x.time_boot // 1000, x.value, _bytes("NAMED_VALUE_FLOAT: name", x.name, _NAME)


def camera_tracking(s: m.Source, f: Fields) -> m.CameraTrackingGeo | None:
    """Decode CAMERA_TRACKING_GEO_STATUS; return None if a field is invalid."""
    latitude, longitude, altitude = f[:3]
    # A camera reports an unknown velocity as NaN; accuracies may hold any value.
    north, east, down = f[5:8]
    if not (on_globe(latitude, longitude) and isfinite(altitude)):
        return None
    velocity = (north, east, down) if isfinite(north + east + down) else None
    return m.CameraTrackingGeo(s, f[12], latitude / 1e7, longitude / 1e7, altitude, velocity)


def camera_tracking_fields(x: m.CameraTrackingGeo) -> Fields:
    """Encode CAMERA_TRACKING_GEO_STATUS; raise EncodeError for a value that does not fit."""
    return (
        degrees_e7("latitude", x.latitude, 90),
        degrees_e7("longitude", x.longitude, 180),
        x.altitude,
        nan,
        nan,
        *(x.velocity_ned or (nan, nan, nan)),
        *(nan,) * 4,
        x.status,
        0,
    )


def obstacle_distance(s: m.Source, f: Fields) -> m.ObstacleDistance:
    """Decode OBSTACLE_DISTANCE."""
    time, distances = f[0], f[1 : 1 + SECTORS]
    least, most, sensor, whole, increment, offset, frame = f[1 + SECTORS :]
    return m.ObstacleDistance(
        s,
        time,
        sensor,
        tuple(None if distance == UNKNOWN_U16 else distance / 1e2 for distance in distances),
        radians(increment or whole),
        least / 1e2,
        most / 1e2,
        radians(offset),
        frame,
    )


def obstacle_distance_fields(x: m.ObstacleDistance) -> Fields:
    """Encode OBSTACLE_DISTANCE; raise EncodeError for a value that does not fit."""
    if len(x.distances) != SECTORS:
        raise EncodeError(f"OBSTACLE_DISTANCE: {len(x.distances)} distances; allowed: {SECTORS}")
    return (
        x.time,
        *(UNKNOWN_U16 if distance is None else round(distance * 1e2) for distance in x.distances),
        round(x.min_distance * 1e2),
        round(x.max_distance * 1e2),
        x.sensor,
        0,
        degrees(x.increment),
        degrees(x.offset),
        x.frame,
    )
