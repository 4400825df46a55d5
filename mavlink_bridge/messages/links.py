"""Messages of links: time, delay, signing, and bytes of other protocols."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.key import Key
from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields
from mavlink_bridge.messages.source import Source

TUNNEL_LENGTH = 128


@message("SYSTEM_TIME")
class SystemTime(NamedTuple):
    """SYSTEM_TIME (2): Unix time and time since boot, µs."""

    source: Source
    unix_time: int
    time_boot: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> SystemTime:
        return SystemTime(source, fields[0], fields[1] * 1000)

    def encode(self) -> Fields:
        return self.unix_time, self.time_boot // 1000


@message("PING")
class Ping(NamedTuple):
    """PING (4); ``time``: µs, Unix time or time since boot."""

    source: Source
    time: int
    sequence: int
    target_system: int
    target_component: int


@message("TIMESYNC")
class Timesync(NamedTuple):
    """TIMESYNC (111): ``tc1`` and ``ts1`` in ns, as in the message; tc1 = 0 is a request."""

    source: Source
    tc1: int
    ts1: int


@message("TUNNEL")
class Tunnel(NamedTuple):
    """TUNNEL (385): up to 128 bytes of ``payload_type``."""

    source: Source
    target_system: int
    target_component: int
    payload_type: int
    payload: bytes

    @staticmethod
    def decode(source: Source, fields: Fields) -> Tunnel | None:
        payload_type, system, component, length, payload = fields
        if length > TUNNEL_LENGTH:
            return None
        return Tunnel(source, system, component, payload_type, payload[:length])

    def encode(self) -> Fields:
        if len(self.payload) > TUNNEL_LENGTH:
            raise EncodeError(f"TUNNEL: payload of {len(self.payload)} bytes is longer than {TUNNEL_LENGTH}")
        return (
            self.payload_type,
            self.target_system,
            self.target_component,
            len(self.payload),
            bytes(self.payload),
        )


@message("SETUP_SIGNING")
class SetupSigning(NamedTuple):
    """SETUP_SIGNING (256): sign with ``key`` from now on.

    ``since`` is the current time in units of 10 µs since 2015-01-01. Zeros in both end signing.
    """

    source: Source
    since: int
    target_system: int
    target_component: int
    key: Key

    @staticmethod
    def decode(source: Source, fields: Fields) -> SetupSigning:
        return SetupSigning(source, fields[0], fields[1], fields[2], Key(fields[3]))

    def encode(self) -> Fields:
        return self.since, self.target_system, self.target_component, bytes(self.key)
