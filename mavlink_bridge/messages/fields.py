"""Conversions of fields that several messages share.

Unless a class says otherwise, messages convert degE7 ↔ degrees (float64), mm, cm/s, mV, % ↔ m, m/s, V, 0…1,
cdeg ↔ rad, ms ↔ µs (rounded down to ms), and markers of *unknown* ↔ None.
"""

from __future__ import annotations

from typing import Any

from mavlink_bridge.errors import EncodeError

Fields = tuple[Any, ...]
"""Fields of a payload, in MAVLink's wire order and units."""

UNKNOWN_U16 = 0xFFFF
FULL_CIRCLE_CDEG = 36000


def degrees_e7(latitude: float, longitude: float) -> tuple[int, int]:
    """Return latitude and longitude (degrees) in degE7; raise EncodeError beyond ±90° and ±180°."""
    for name, value, limit in (("latitude", latitude, 90), ("longitude", longitude, 180)):
        if abs(value) > limit:
            raise EncodeError(f"{name} = {value} is outside ±{limit}°")
    return round(latitude * 1e7), round(longitude * 1e7)


def on_globe(latitude_e7: int, longitude_e7: int) -> bool:
    """Return whether latitude and longitude (degE7) are within ±90° and ±180°."""
    return abs(latitude_e7) <= 900_000_000 and abs(longitude_e7) <= 1_800_000_000


def int16(value: float) -> int:
    """Return ``value`` rounded and limited to int16, as a sensor saturates."""
    return max(-0x8000, min(0x7FFF, round(value)))


def or_none(value: int, scale: float) -> float | None:
    """Return ``value / scale``, or None if the uint16 ``value`` means *unknown*."""
    return None if value == UNKNOWN_U16 else value / scale


def or_unknown(name: str, value: float | None, scale: float) -> int:
    """Return ``value · scale`` as uint16, or the marker of *unknown* for None.

    Raises EncodeError for a value that would be read as unknown.
    """
    if value is None:
        return UNKNOWN_U16
    field = round(value * scale)
    if field == UNKNOWN_U16:
        raise EncodeError(f"{name} = {value} would read as unknown")
    return field


def ascii_text(field: bytes) -> str:
    """Decode ASCII up to the first NUL; each non-ASCII byte becomes a question mark."""
    return field.split(b"\0", 1)[0].decode("ascii", errors="replace").replace("\ufffd", "?")


def ascii_bytes(name: str, text: str, max_length: int) -> bytes:
    """Encode ``text`` in ASCII, other characters as question marks.

    Raises EncodeError if it is longer than ``max_length`` characters.
    """
    data = text.encode("ascii", errors="replace")
    if len(data) > max_length:
        raise EncodeError(f"{name} = {text!r} is longer than {max_length} characters")
    return data
