"""Who signs: codecs of ours and pymavlink's, with one key."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge.key import Key
from mavlink_bridge.messages import Ping, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Frame, frame_at
from mavlink_bridge.wire.signing import EPOCH, UNIT, Signing

KEY = Key.of_passphrase("correct horse")
NOW = 1_780_000_000_000_000
"""Unix time (µs), in 2026."""
SECOND = 100_000
"""Steps of a stamp."""
ME = Source(255, 190)


def stamp_at(unix: int) -> int:
    return (unix - EPOCH) // UNIT


def signing(now: int = NOW, key: Key | None = KEY, **more: Any) -> Signing:
    made = Signing(key, **more)
    made.present(now)
    return made


def peer(now: int = NOW, key: Key = KEY, source: Source = ME, link: int = 0) -> Any:
    """Of pymavlink, which signs and reads what it is told."""
    made = dialect.MAVLink(None, *source)
    made.signing.secret_key = bytes(key)
    made.signing.sign_outgoing = True
    made.signing.timestamp = stamp_at(now)
    made.signing.link_id = link
    return made


def beat(number: int = 0, source: Source = ME) -> Ping:
    return Ping(source, 7, number, 0, 0)


def signed(stamp: int, number: int = 0, key: Key = KEY, source: Source = ME, link: int = 0) -> bytes:
    """A frame with just that stamp."""
    maker = Signing(key)
    maker.newest = stamp - 1
    return Codec(None, maker, link).encode(beat(number, source))


def frame_of(data: bytes) -> Frame:
    frame = frame_at(data, 0)
    assert isinstance(frame, Frame)
    return frame
