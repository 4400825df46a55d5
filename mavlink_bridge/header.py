"""Who speaks in a datagram, read from the header of its first frame without looking further."""

from __future__ import annotations

from typing import Final

_MAGIC: Final = {0xFD: 5, 0xFE: 3}
"""Where MAVLink 2 and 1 have the system id."""


def sending_system(data: bytes) -> int:
    """System id in the header of the first frame; 0, which nobody has, if there is none."""
    place = _MAGIC.get(data[0]) if data else None
    return data[place] if place is not None and place < len(data) else 0
