"""A client of MAVLink FTP: requests as bytes, answers as tuples; files by single reads or by bursts."""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as dialect

from tests.sitl.outside_client import Client

HEADER = struct.Struct("<HBBBBBxI")
ACK, NAK, EOF = 128, 129, 6
TERMINATE, RESET, LIST, OPEN, READ, CRC, BURST = 1, 2, 3, 4, 5, 14, 15


class Answer(NamedTuple):
    sequence: int
    session: int
    said: int
    asked: int
    complete: int
    offset: int
    data: bytes


class Ftp:
    def __init__(self, client: Client) -> None:
        self.client = client
        client.rig.most = 4
        self.sequence = 0

    def request(
        self, opcode: int, data: bytes = b"", session: int = 0, offset: int = 0, size: int = 0
    ) -> Any:
        """The message of a request; every one has a new number."""
        self.sequence += 2
        head = HEADER.pack(self.sequence, session, opcode, size or len(data), 0, 0, offset)
        return dialect.MAVLink_file_transfer_protocol_message(0, 11, 1, (head + data).ljust(251, b"\0"))

    def ask(self, opcode: int, data: bytes = b"", session: int = 0, offset: int = 0, size: int = 0) -> Answer:
        """The one answer to a request."""
        (found,) = answers(self.client.send(self.request(opcode, data, session, offset, size)))
        assert found.sequence == self.sequence + 1
        return found

    def open(self, path: str, session: int = 0) -> tuple[int, int]:
        """Session and size of a file."""
        found = self.ask(OPEN, path.encode(), session)
        assert found.said == ACK, found
        return found.session, int.from_bytes(found.data, "little")

    def read(self, path: str, size: int = 239) -> bytes:
        """A file by single reads."""
        session, length = self.open(path)
        data = b""
        while (found := self.ask(READ, session=session, offset=len(data), size=size)).said == ACK:
            data += found.data
        assert found.data == bytes((EOF,))
        assert len(data) == length
        assert self.ask(TERMINATE, session=session).said == ACK
        return data

    def burst(self, path: str, size: int = 239) -> bytes:
        """A file by bursts."""
        session, length = self.open(path)
        data = b""
        while len(data) < length:
            found = answers(self.client.send(self.request(BURST, b"", session, len(data), size)))
            while not (found and (found[-1].said == NAK or found[-1].complete)):
                found += answers(self.client.wait(0.01))
            for packet in found:
                if packet.said == ACK:
                    assert packet.offset == len(data)
                    data += packet.data
        return data

    def entries(self, path: str) -> list[str]:
        """The entries of a directory."""
        found: list[str] = []
        while (answer := self.ask(LIST, path.encode(), offset=len(found))).said == ACK:
            found += answer.data.rstrip(b"\0").decode().split("\0")
        assert answer.data == bytes((EOF,))
        return found


def answers(messages: list[Any]) -> list[Answer]:
    found = []
    for message in messages:
        if message.get_type() == "FILE_TRANSFER_PROTOCOL":
            payload = bytes(message.payload)
            sequence, session, said, size, asked, complete, offset = HEADER.unpack_from(payload)
            found.append(Answer(sequence, session, said, asked, complete, offset, payload[12 : 12 + size]))
    return found
