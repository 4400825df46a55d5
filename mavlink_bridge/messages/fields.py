"""Conversions of fields that several messages share.

degE7 ↔ degrees (float64), mm, cm/s, mV, % ↔ m, m/s, V, 0…1; cdeg ↔ rad; ms ↔ µs (the rest is lost); markers
of *unknown* ↔ None.
"""

from __future__ import annotations

from typing import Any

from mavlink_bridge.errors import EncodeError

Fields = tuple[Any, ...]
"""Fields of a payload, in MAVLink's wire order and units."""

UNKNOWN_U16 = 0xFFFF
FULL_CIRCLE_CDEG = 36000


def degrees_e7(latitude: float, longitude: float) -> tuple[int, int]:
    """Return both (degrees) as degE7; raise EncodeError beyond ±90° and ±180°."""
    for name, value, limit in (("latitude", latitude, 90), ("longitude", longitude, 180)):
        if abs(value) > limit:
            raise EncodeError(f"{name} = {value} is outside ±{limit}°")
    return round(latitude * 1e7), round(longitude * 1e7)


def on_globe(latitude_e7: int, longitude_e7: int) -> bool:
    """Return whether the position (degE7) exists."""
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
    """Decode ASCII up to the first NUL; other characters become question marks, as in ``ascii_bytes``."""
    return field.split(b"\0", 1)[0].decode("ascii", errors="replace").replace("\ufffd", "?")


def ascii_bytes(name: str, text: str, most: int) -> bytes:
    """Encode ``text`` in ASCII; raise EncodeError if it is longer than ``most`` characters."""
    data = text.encode("ascii", errors="replace")
    if len(data) > most:
        raise EncodeError(f"{name} = {text!r} is longer than {most} characters")
    return data
