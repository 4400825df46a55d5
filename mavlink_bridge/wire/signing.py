"""MAVLink 2 message signing: proof that a holder of the key made a frame, and that the frame is new.

Source: the MAVLink guide, "Message Signing". A signed frame ends with 13 bytes: the link id, a time stamp of
48 bits in 10 µs since 2015, and the first 48 bits of SHA-256 over the key and all that precedes them.
"""

from __future__ import annotations

import hmac
from collections.abc import Collection
from enum import Enum
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.key import Key
from mavlink_bridge.wire.framing import Frame

EPOCH: Final = 1_420_070_400_000_000
"""Unix time of the stamp 0, 2015-01-01 (µs)."""
UNIT: Final = 10
"""Step of a stamp (µs)."""
LATEST: Final = (1 << 48) - 1
"""Last possible stamp, in the year 2104."""
MINUTE: Final = 6_000_000
"""Steps of a stamp in a minute: the first stamp of a new stream may be this far behind the newest stamp."""
LEAD: Final = 366 * 24 * 60 * MINUTE
"""Steps of a stamp by which a sender's clock may lead the own one, where that is known: a year.

Computers without a battery for their clock may be months behind. But a stamp at the end of time would make
every honest stamp look old.
"""
STREAMS: Final = 256
"""Largest number of remembered streams; only a holder of the key can create a stream."""
RADIOS: Final = frozenset((mavlink.MAVLINK_MSG_ID_RADIO_STATUS, mavlink.MAVLINK_MSG_ID_RADIO))
"""Messages of telemetry radios, which have no key."""


class Refusal(Enum):
    """Reason why a frame is refused."""

    UNSIGNED = "not signed"
    FORGED = "signed with another key"
    OLD = "old, or heard before"
    AHEAD = "more than a year ahead of this clock"


class Signing:
    """Signing state of one node: the key, the time, and the newest stamp of each stream.

    A stream is a combination of sending system, component and link id. One object serves all links of a node,
    so that a frame received on one cannot be replayed on another; nodes do not share it.

    Without a key nothing is signed and every frame is accepted. ``newest``: the newest stamp (10 µs since
    2015) that was sent, received or set as the current time; store it, and pass it to ``resume`` after a
    restart.
    """

    def __init__(self, key: Key | None = None, unsigned: Collection[int] = RADIOS) -> None:
        """Create the state; ``unsigned``: ids of messages that are accepted without a signature.

        A wrong signature is never accepted.
        """
        self.key = key
        self.newest = 0
        self.refused = dict.fromkeys(Refusal, 0)
        self.latest: Refusal | None = None
        self._unsigned = frozenset(unsigned)
        self._streams: dict[tuple[int, int, int], int] = {}
        self._floor = 0
        self._began = False
        self._clock = 0
        """The own time as a stamp; 0 where it is not known."""

    def present(self, unix: int) -> None:
        """Set the current time to ``unix`` (µs).

        A node without the time of day may count from any instant before 2015. After the first call, frames of
        a new stream are refused if their stamp is not later than the time of that call: they may have been
        recorded before a restart. A new key ends this refusal.
        """
        stamp = (unix - EPOCH) // UNIT
        self._clock = max(stamp, 0)
        if stamp > self.newest:
            self.newest = min(stamp, LATEST)
        if not self._began:
            self._began = True
            self._floor = max(self._floor, min(stamp, LATEST))

    def resume(self, newest: int) -> None:
        """Continue after a restart: no stamp up to ``newest`` (10 µs since 2015) is accepted or sent."""
        self.newest = max(self.newest, min(newest, LATEST))
        self._floor = max(self._floor, self.newest)

    def use(self, key: Key | None, since: int = 0) -> None:
        """Replace the key (None: no key) from now on, and raise ``newest`` to ``since`` if it is earlier."""
        if key != self.key:
            self.key, self._floor = key, 0
            self._streams.clear()
        self.newest = max(self.newest, min(since, LATEST))

    def sign(self, frame: bytes, link: int) -> bytes:
        """Return ``frame``, whose header must be marked as signed, with its signature; ``link``: 0…255.

        Each stamp is later than the previous one. Raises ValueError without a key.
        """
        if self.key is None:
            raise ValueError("there is no key to sign with")
        self.newest = min(self.newest + 1, LATEST)
        data = frame + bytes((link,)) + self.newest.to_bytes(6, "little")
        return data + self.key.signature(data)

    def check(self, frame: Frame) -> Refusal | None:
        """Return why ``frame`` is refused, or None if it is accepted; a second copy is refused as old."""
        if self.key is None:
            return None
        refusal = self._judged(frame, self.key)
        if refusal is not None:
            self.refused[refusal] += 1
            self.latest = refusal
        return refusal

    def _judged(self, frame: Frame, key: Key) -> Refusal | None:
        if not frame.signed:
            return None if frame.message_id in self._unsigned else Refusal.UNSIGNED
        data = frame.data
        stream = frame.system, frame.component, data[-13]
        stamp = int.from_bytes(data[-12:-6], "little")
        before = self._streams.get(stream)
        if before is None:
            before = max(self._floor, self.newest - MINUTE - 1)
        if stamp <= before:
            return Refusal.OLD
        if not hmac.compare_digest(key.signature(data[:-6]), data[-6:]):
            return Refusal.FORGED
        # Stamps from before a restart prove that it is later than a clock that was not set says.
        if self._clock and stamp > max(self._clock, self._floor) + LEAD:
            return Refusal.AHEAD
        # Stored only after the signature is verified. Otherwise a forged stamp in the future would block the
        # true sender until that time.
        self._remember(stream, stamp)
        self.newest = max(self.newest, stamp)
        return None

    def _remember(self, stream: tuple[int, int, int], stamp: int) -> None:
        streams = self._streams
        if stream not in streams and len(streams) >= STREAMS:
            # Drop the stream with the oldest stamp. New streams, and this one if it resumes, must be later.
            silent = min(streams, key=streams.__getitem__)
            self._floor = max(self._floor, streams.pop(silent))
        streams[stream] = stamp
