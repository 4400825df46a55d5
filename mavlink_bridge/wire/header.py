"""Who says what, read from the header of a frame without looking further."""

from __future__ import annotations

from typing import Final, NamedTuple

_MAGIC: Final = {0xFD: 5, 0xFE: 3}
"""Where MAVLink 2 and 1 have the system id."""


def sending_system(data: bytes) -> int:
    """System id in the header of the first frame; 0, which nobody has, if there is none."""
    place = _MAGIC.get(data[0]) if data else None
    return data[place] if place is not None and place < len(data) else 0


class Header(NamedTuple):
    """Who says what."""

    system: int
    component: int
    message_id: int


def header(frame: bytes) -> Header:
    """Of a whole frame."""
    if frame[0] == 0xFD:
        return Header(frame[5], frame[6], int.from_bytes(frame[7:10], "little"))
    return Header(frame[3], frame[4], frame[5])
