"""Messages of parameters and of files."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields, ascii_bytes, ascii_text
from mavlink_bridge.messages.source import Source

NAME_LENGTH = 16
FILE_LENGTH = 251


def _four(raw: bytes) -> bytes:
    if len(raw) != 4:
        raise EncodeError(f"param_value = {raw.hex()} is not four bytes")
    return raw


@message("PARAM_REQUEST_READ")
class ParamRequestRead(NamedTuple):
    """PARAM_REQUEST_READ (20): by ``number``, or by ``name`` if ``number`` is −1."""

    source: Source
    number: int
    target_system: int
    target_component: int
    name: str

    @staticmethod
    def decode(source: Source, fields: Fields) -> ParamRequestRead:
        return ParamRequestRead(source, fields[0], fields[1], fields[2], ascii_text(fields[3]))

    def encode(self) -> Fields:
        return (
            self.number,
            self.target_system,
            self.target_component,
            ascii_bytes("param_id", self.name, NAME_LENGTH),
        )


@message("PARAM_REQUEST_LIST")
class ParamRequestList(NamedTuple):
    """PARAM_REQUEST_LIST (21)."""

    source: Source
    target_system: int
    target_component: int


@message("PARAM_VALUE", layout="<4sHH16sB")
class ParamValue(NamedTuple):
    """PARAM_VALUE (22): parameter ``number`` of ``total``.

    ``raw``: the four bytes of the value as sent. Their meaning depends on the firmware, and an integer in
    them may look like a signalling NaN, which a conversion to float would change.
    """

    source: Source
    raw: bytes
    total: int
    number: int
    name: str
    type: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> ParamValue:
        return ParamValue(source, fields[0], fields[1], fields[2], ascii_text(fields[3]), fields[4])

    def encode(self) -> Fields:
        return (
            _four(self.raw),
            self.total,
            self.number,
            ascii_bytes("param_id", self.name, NAME_LENGTH),
            self.type,
        )


@message("PARAM_SET", layout="<4sBB16sB")
class ParamSet(NamedTuple):
    """PARAM_SET (23); ``raw`` as in ``ParamValue``."""

    source: Source
    raw: bytes
    target_system: int
    target_component: int
    name: str
    type: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> ParamSet:
        return ParamSet(source, fields[0], fields[1], fields[2], ascii_text(fields[3]), fields[4])

    def encode(self) -> Fields:
        return (
            _four(self.raw),
            self.target_system,
            self.target_component,
            ascii_bytes("param_id", self.name, NAME_LENGTH),
            self.type,
        )


@message("FILE_TRANSFER_PROTOCOL")
class FileTransfer(NamedTuple):
    """FILE_TRANSFER_PROTOCOL (110): up to 251 bytes of MAVLink FTP (received ones: padded to 251)."""

    source: Source
    target_network: int
    target_system: int
    target_component: int
    payload: bytes

    def encode(self) -> Fields:
        if len(self.payload) > FILE_LENGTH:
            raise EncodeError(
                f"FILE_TRANSFER_PROTOCOL: {len(self.payload)} bytes are more than {FILE_LENGTH}"
            )
        return self.target_network, self.target_system, self.target_component, bytes(self.payload)
