"""What several messages have in common: places on the globe, markers of *unknown*, fields as they are."""

from __future__ import annotations

from typing import Any

from mavlink_bridge.errors import EncodeError

Fields = tuple[Any, ...]

UNKNOWN_U16 = 0xFFFF
FULL_CIRCLE_CDEG = 36000


def degrees_e7(name: str, value: float, limit: int) -> int:
    """degE7; raises EncodeError beyond ``limit``."""
    if abs(value) > limit:
        raise EncodeError(f"{name} = {value} is outside ±{limit}°")
    return round(value * 1e7)


def int16(value: float) -> int:
    """Rounded, and the nearest that fits, for a sensor that saturates."""
    return max(-0x8000, min(0x7FFF, round(value)))


def on_globe(latitude_e7: int, longitude_e7: int) -> bool:
    """Whether there is such a place."""
    return abs(latitude_e7) <= 900_000_000 and abs(longitude_e7) <= 1_800_000_000


def unchanged(x: Any) -> Fields:
    """All but the source, for messages that have their fields in wire order and in MAVLink's units."""
    return tuple(x[1:])
