"""MAVLink FTP (FILE_TRANSFER_PROTOCOL, 110): a server of read-only files.

Every request is answered. A request that would write is refused (FileProtected). A burst is sent ten packets
at a time, so that no buffer overflows.
"""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import FileTransfer, Message, Source
from sitl.autopilot.component_files import ComponentFiles
from sitl.values.checksum import crc32

_HEADER: Final = Struct("<HBBBBBxI")
_SIZE: Final = Struct("<I")
_LENGTH: Final = 251
_MOST: Final = _LENGTH - _HEADER.size
_WRITING: Final = frozenset(
    (
        mavlink.MAV_FTP_OPCODE_CREATEFILE,
        mavlink.MAV_FTP_OPCODE_WRITEFILE,
        mavlink.MAV_FTP_OPCODE_REMOVEFILE,
        mavlink.MAV_FTP_OPCODE_CREATEDIRECTORY,
        mavlink.MAV_FTP_OPCODE_REMOVEDIRECTORY,
        mavlink.MAV_FTP_OPCODE_OPENFILEWO,
        mavlink.MAV_FTP_OPCODE_TRUNCATEFILE,
        mavlink.MAV_FTP_OPCODE_RENAME,
    )
)
_SESSIONS: Final = 16
_IDLE_US: Final = 3_000_000
_BURST, _BURST_INTERVAL_US = 10, 10_000
# Packets after which a burst pauses for the client's next request.
_BURST_LENGTH: Final = 500
_NEVER: Final = 1 << 62


class _Request(NamedTuple):
    sequence: int
    session: int
    opcode: int
    size: int
    offset: int
    data: bytes


class _Session:
    """An open file. ``opening``: the request that opened it; ``used``: time of the last request (µs)."""

    def __init__(self, opening: bytes, contents: bytes, now: int) -> None:
        self.opening, self.contents, self.used = opening, contents, now


class _Burst(NamedTuple):
    client: Source
    number: int
    sequence: int
    offset: int
    size: int
    left: int


class _Refused(Exception):  # noqa: N818 - it is the answer NAK, not an error of the program
    def __init__(self, error: int) -> None:
        super().__init__(error)
        self.error = error


class FileServer:
    """Server of ``files``. ``next_due`` (µs): no ``work`` is due before it."""

    def __init__(
        self, source: Source, outbox: list[Message], files: ComponentFiles, *, chooses_session: bool
    ) -> None:
        """``chooses_session``: the server numbers sessions, as PX4; else the client, as with ArduPilot."""
        self._source, self._outbox, self._files = source, outbox, files
        self._chooses = chooses_session
        self._sessions: dict[tuple[Source, int], _Session] = {}
        self._bursts: list[_Burst] = []
        self.next_due = _NEVER
        self.handlers: dict[type[Any], Callable[[Any, int], None]] = {FileTransfer: self.handle}

    def handle(self, message: FileTransfer, now: int) -> None:
        """Handle a request that arrived at ``now`` (µs)."""
        payload = message.payload.ljust(_LENGTH, b"\0")
        sequence, session, opcode, size, _, _, offset = _HEADER.unpack_from(payload)
        if opcode >= mavlink.MAV_FTP_OPCODE_ACK:
            return
        data = payload[_HEADER.size : _HEADER.size + min(size, _MOST)]
        request = _Request(sequence, session, opcode, size, offset, data)
        try:
            if opcode == mavlink.MAV_FTP_OPCODE_BURSTREADFILE:
                self._begin_burst(message.source, request, now)
                return
            number, answer = self._answer(message.source, request, now)
            said, answered = mavlink.MAV_FTP_OPCODE_ACK, answer
        except _Refused as refused:
            number, said, answered = session, mavlink.MAV_FTP_OPCODE_NAK, bytes((refused.error,))
        self._send(message.source, sequence + 1, number, said, opcode, answered, offset)

    def work(self, now: int) -> None:
        """Send the next packets of each burst."""
        going = self._bursts
        self._bursts = []
        for burst in going:
            session = self._sessions.get((burst.client, burst.number))
            if session is not None:
                session.used = now
                self._send_burst(burst, session.contents)
        self.next_due = now + _BURST_INTERVAL_US if self._bursts else _NEVER

    def _answer(self, client: Source, request: _Request, now: int) -> tuple[int, bytes]:
        """Return the session's number and the data of the answer."""
        number = request.session
        match request.opcode:
            case mavlink.MAV_FTP_OPCODE_NONE:
                answer = b""
            case mavlink.MAV_FTP_OPCODE_TERMINATESESSION:
                self._close(client, number)
                answer = b""
            case mavlink.MAV_FTP_OPCODE_RESETSESSION:
                for key in [key for key in self._sessions if key[0] == client]:
                    self._close(*key)
                answer = b""
            case mavlink.MAV_FTP_OPCODE_LISTDIRECTORY:
                answer = self._listed(request)
            case mavlink.MAV_FTP_OPCODE_OPENFILERO:
                number, answer = self._open(client, request, now)
            case mavlink.MAV_FTP_OPCODE_READFILE:
                answer = self._read(self._session(client, number, now), request)
            case mavlink.MAV_FTP_OPCODE_CALCFILECRC:
                answer = _SIZE.pack(crc32(self._contents(request)))
            case opcode if opcode in _WRITING:
                raise _Refused(mavlink.MAV_FTP_ERR_FILEPROTECTED)
            case _:
                raise _Refused(mavlink.MAV_FTP_ERR_UNKNOWNCOMMAND)
        return number, answer

    def _contents(self, request: _Request) -> bytes:
        contents = self._files.read(_path(request))
        if contents is None:
            raise _Refused(mavlink.MAV_FTP_ERR_FILENOTFOUND)
        return contents

    def _open(self, client: Source, request: _Request, now: int) -> tuple[int, bytes]:
        opening = bytes((request.sequence & 0xFF, request.sequence >> 8)) + request.data
        mine = {number: session for (of, number), session in self._sessions.items() if of == client}
        for number, session in mine.items():
            # The answer was lost, and the client repeats its request.
            if self._chooses and session.opening == opening and now - session.used < _IDLE_US:
                session.used = now
                return number, _SIZE.pack(len(session.contents))
        contents = self._contents(request)
        number = request.session
        if self._chooses:
            number = min(set(range(len(mine) + 1)) - set(mine))
        self._close(client, number)
        self._make_room(now)
        self._sessions[client, number] = _Session(opening, contents, now)
        return number, _SIZE.pack(len(contents))

    def _make_room(self, now: int) -> None:
        if len(self._sessions) < _SESSIONS:
            return
        oldest = min(self._sessions, key=lambda key: self._sessions[key].used)
        if now - self._sessions[oldest].used < _IDLE_US:
            raise _Refused(mavlink.MAV_FTP_ERR_NOSESSIONSAVAILABLE)
        self._close(*oldest)

    def _close(self, client: Source, number: int) -> None:
        """Close the session, if it is open, and end its burst."""
        self._sessions.pop((client, number), None)
        self._bursts = [burst for burst in self._bursts if burst[:2] != (client, number)]

    def _session(self, client: Source, number: int, now: int) -> _Session:
        session = self._sessions.get((client, number))
        if session is None:
            raise _Refused(mavlink.MAV_FTP_ERR_INVALIDSESSION)
        session.used = now
        return session

    def _read(self, session: _Session, request: _Request) -> bytes:
        size = min(request.size or _MOST, _MOST)
        data = session.contents[request.offset : request.offset + size]
        if not data:
            raise _Refused(mavlink.MAV_FTP_ERR_EOF)
        return data

    def _listed(self, request: _Request) -> bytes:
        entries = self._files.directory(_path(request))
        if entries is None:
            raise _Refused(mavlink.MAV_FTP_ERR_FILENOTFOUND)
        data = b""
        for entry in entries[request.offset :]:
            piece = entry.encode() + b"\0"
            if len(data) + len(piece) > _MOST:
                break
            data += piece
        if not data:
            raise _Refused(mavlink.MAV_FTP_ERR_EOF)
        return data

    def _begin_burst(self, client: Source, request: _Request, now: int) -> None:
        self._session(client, request.session, now)
        size = min(request.size or _MOST, _MOST)
        burst = _Burst(client, request.session, request.sequence + 1, request.offset, size, _BURST_LENGTH)
        # A client that asks again wants the burst from there, not both.
        self._bursts = [other for other in self._bursts if other[:2] != burst[:2]] + [burst]
        self.next_due = min(self.next_due, now)

    def _send_burst(self, burst: _Burst, contents: bytes) -> None:
        client, number, sequence, offset, size, left = burst
        opcode = mavlink.MAV_FTP_OPCODE_BURSTREADFILE
        for _ in range(_BURST):
            data = contents[offset : offset + size]
            if not data:
                end = bytes((mavlink.MAV_FTP_ERR_EOF,))
                self._send(client, sequence, number, mavlink.MAV_FTP_OPCODE_NAK, opcode, end, offset)
                return
            left -= 1
            ack = mavlink.MAV_FTP_OPCODE_ACK
            self._send(client, sequence, number, ack, opcode, data, offset, complete=not left)
            sequence, offset = sequence + 1, offset + len(data)
            if not left:
                return
        self._bursts.append(_Burst(client, number, sequence, offset, size, left))

    def _send(
        self,
        client: Source,
        sequence: int,
        number: int,
        said: int,
        opcode: int,
        data: bytes,
        offset: int,
        *,
        complete: bool = False,
    ) -> None:
        head = _HEADER.pack(sequence & 0xFFFF, number, said, len(data), opcode, complete, offset)
        payload = (head + data).ljust(_LENGTH, b"\0")
        self._outbox.append(FileTransfer(self._source, 0, *client, payload))


def _path(request: _Request) -> str:
    text = request.data.partition(b"\0")[0].decode("utf-8", errors="replace")
    return text.strip("/").removeprefix("./").strip(".") if text.strip("/") != "." else ""
