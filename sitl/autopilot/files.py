"""MAVLink FTP (FILE_TRANSFER_PROTOCOL, 110) of a vehicle without files.

Every request is answered at once, so that clients which prefer files fall back to messages.
"""

from __future__ import annotations

from struct import Struct
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import FileTransfer, Source

_HEADER: Final = Struct("<HBBBBBxI")
_OF_FILES: Final = (
    mavlink.MAV_FTP_OPCODE_LISTDIRECTORY,
    mavlink.MAV_FTP_OPCODE_OPENFILERO,
    mavlink.MAV_FTP_OPCODE_CREATEFILE,
    mavlink.MAV_FTP_OPCODE_REMOVEFILE,
    mavlink.MAV_FTP_OPCODE_OPENFILEWO,
    mavlink.MAV_FTP_OPCODE_TRUNCATEFILE,
    mavlink.MAV_FTP_OPCODE_RENAME,
    mavlink.MAV_FTP_OPCODE_CALCFILECRC,
)
_OF_SESSIONS: Final = (
    mavlink.MAV_FTP_OPCODE_READFILE,
    mavlink.MAV_FTP_OPCODE_WRITEFILE,
    mavlink.MAV_FTP_OPCODE_BURSTREADFILE,
)


def answer(message: FileTransfer, source: Source) -> FileTransfer | None:
    """Return the answer to a request; None if the message is an answer itself."""
    sequence, session, opcode, *_ = _HEADER.unpack_from(message.payload)
    if opcode >= mavlink.MAV_FTP_OPCODE_ACK:
        return None
    if opcode in (mavlink.MAV_FTP_OPCODE_TERMINATESESSION, mavlink.MAV_FTP_OPCODE_RESETSESSION):
        said, data = mavlink.MAV_FTP_OPCODE_ACK, b""
    else:
        said, data = mavlink.MAV_FTP_OPCODE_NAK, bytes((_error(opcode),))
    head = _HEADER.pack((sequence + 1) & 0xFFFF, session, said, len(data), opcode, 0, 0)
    payload = (head + data).ljust(len(message.payload), b"\0")
    return FileTransfer(source, 0, *message.source, payload)


def _error(opcode: int) -> int:
    error: int = mavlink.MAV_FTP_ERR_UNKNOWNCOMMAND
    if opcode in _OF_FILES:
        error = mavlink.MAV_FTP_ERR_FILENOTFOUND
    elif opcode in _OF_SESSIONS:
        error = mavlink.MAV_FTP_ERR_INVALIDSESSION
    return error
