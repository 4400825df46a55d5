"""Sender, message id and command of a frame, read without decoding the message."""

from __future__ import annotations

from struct import Struct
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

_SYSTEM_OFFSETS: Final = {mavlink.PROTOCOL_MARKER_V2: 5, mavlink.PROTOCOL_MARKER_V1: 3}
"""Offset of the system id in a frame, by the frame's start byte."""


def sending_system(data: bytes) -> int:
    """Return the system id of the frame at the beginning of ``data``; 0, an invalid id, if there is none."""
    place = _SYSTEM_OFFSETS.get(data[0]) if data else None
    return data[place] if place is not None and place < len(data) else 0


class Header(NamedTuple):
    """Sender and message id of a frame."""

    system: int
    component: int
    message_id: int


def header(frame: bytes) -> Header:
    """Read the header of a complete frame."""
    if frame[0] == mavlink.PROTOCOL_MARKER_V2:
        return Header(frame[5], frame[6], int.from_bytes(frame[7:10], "little"))
    return Header(frame[3], frame[4], frame[5])


_COMMAND: Final = Struct("<28xHBB")
"""Command and addressee in COMMAND_LONG (76), after seven floats."""


class Command(NamedTuple):
    """MAV_CMD of a COMMAND_LONG and its addressee."""

    command: int
    system: int
    component: int


def command_of(payload: bytes) -> Command:
    """Read the ``payload`` of a COMMAND_LONG; MAVLink 2 truncates trailing zeros."""
    return Command(*_COMMAND.unpack_from(payload.ljust(_COMMAND.size, b"\0")))
