"""CRC-32 of files and of parameters, as MAVLink defines it."""

from __future__ import annotations

import zlib
from typing import Final

_ALL_ONES: Final = 0xFFFFFFFF


def crc32(data: bytes, crc: int = 0) -> int:
    """Return the CRC-32, without inversion at either end, of ``data`` after ``crc``."""
    return zlib.crc32(data, crc ^ _ALL_ONES) ^ _ALL_ONES
