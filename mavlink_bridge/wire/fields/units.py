"""Conversions that several messages share: positions on the globe, markers of *unknown*, unchanged fields."""

from __future__ import annotations

from typing import Any

from mavlink_bridge.errors import EncodeError

Fields = tuple[Any, ...]

UNKNOWN_U16 = 0xFFFF
FULL_CIRCLE_CDEG = 36000


def degrees_e7(name: str, value: float, limit: int) -> int:
    """Return ``value`` (degrees) as degE7; raise EncodeError beyond ``limit``."""
    if abs(value) > limit:
        raise EncodeError(f"{name} = {value} is outside ±{limit}°")
    return round(value * 1e7)


def int16(value: float) -> int:
    """Return ``value`` rounded and limited to int16, as a sensor saturates."""
    return max(-0x8000, min(0x7FFF, round(value)))


def on_globe(latitude_e7: int, longitude_e7: int) -> bool:
    """Return whether the position (degE7) exists."""
    return abs(latitude_e7) <= 900_000_000 and abs(longitude_e7) <= 1_800_000_000


def unchanged(x: Any) -> Fields:
    """Return all fields but the source, for messages with fields in wire order and in MAVLink's units."""
    return tuple(x[1:])
