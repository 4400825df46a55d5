"""MAVLink FTP (FILE_TRANSFER_PROTOCOL, 110) of a vehicle without files.

Every request is answered at once, so that clients which prefer files fall back to messages.
"""

from __future__ import annotations

from struct import Struct
from typing import Final

from mavlink_bridge.messages import FileTransfer, Source

_HEADER: Final = Struct("<HBBBBBxI")
_ACK, _NAK = 128, 129
# Opcodes; the error codes of a NAK
_TERMINATE, _RESET = 1, 2
_LIST, _OPEN, _CREATE, _REMOVE, _OPEN_WRITE, _TRUNCATE, _RENAME, _CRC = 3, 4, 6, 8, 11, 12, 13, 14
_OF_FILES: Final = (_LIST, _OPEN, _CREATE, _REMOVE, _OPEN_WRITE, _TRUNCATE, _RENAME, _CRC)
_NO_SESSION, _UNKNOWN_COMMAND, _NOT_FOUND = 4, 7, 10
_OF_SESSIONS: Final = (5, 7, 15)


def answer(message: FileTransfer, source: Source) -> FileTransfer | None:
    """Return the answer to a request; None if the message is an answer itself."""
    sequence, session, opcode, *_ = _HEADER.unpack_from(message.payload)
    if opcode >= _ACK:
        return None
    if opcode in (_TERMINATE, _RESET):
        said, data = _ACK, b""
    else:
        said, data = _NAK, bytes((_error(opcode),))
    head = _HEADER.pack((sequence + 1) & 0xFFFF, session, said, len(data), opcode, 0, 0)
    payload = (head + data).ljust(len(message.payload), b"\0")
    return FileTransfer(source, 0, *message.source, payload)


def _error(opcode: int) -> int:
    if opcode in _OF_FILES:
        return _NOT_FOUND
    return _NO_SESSION if opcode in _OF_SESSIONS else _UNKNOWN_COMMAND
