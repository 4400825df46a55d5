"""MAVLink 2 message signing: who has the key made this frame, and it was not heard before.

Source: the MAVLink guide, "Message Signing". A signed frame ends with 13 bytes: the link id, a time stamp of
48 bits in 10 µs since 2015, and the first 48 bits of SHA-256 over the key and all that comes before them.
"""

from __future__ import annotations

import hmac
from collections.abc import Collection
from enum import Enum
from typing import Final

from mavlink_bridge.key import Key
from mavlink_bridge.wire.framing import Frame

EPOCH: Final = 1_420_070_400_000_000
"""Unix time of the stamp 0, 2015-01-01 (µs)."""
UNIT: Final = 10
"""µs of a stamp's step."""
LATEST: Final = (1 << 48) - 1
"""The last stamp, in the year 2104."""
MINUTE: Final = 6_000_000
"""Steps by which a stream that was not heard yet may be behind."""
STREAMS: Final = 256
"""Streams that are remembered; only who has the key can make one."""
SETUP_SIGNING: Final = 256
"""The message that hands over a key."""
RADIOS: Final = frozenset((109, 166))
"""RADIO_STATUS and RADIO, which come from telemetry radios, and these have no key."""


class Refusal(Enum):
    """Why a frame does not count."""

    UNSIGNED = "not signed"
    FORGED = "signed with another key"
    OLD = "old, or heard before"


class Signing:
    """What one node knows about signing: the key, the time, and the newest stamp of each stream, that is of
    each sending system, component and link id. One object for all links of a node, so that what was said on
    one cannot be said again on another; not shared between nodes.

    Without a key nothing is signed and everything counts. ``newest``: the newest stamp (10 µs since 2015)
    that was sent or heard; kept over a restart, it goes into ``resume``.
    """

    def __init__(self, key: Key | None = None, unsigned: Collection[int] = RADIOS) -> None:
        """``unsigned``: ids of messages that count without a signature. A wrong signature never counts."""
        self.key = key
        self.newest = 0
        self.refused = dict.fromkeys(Refusal, 0)
        self.latest: Refusal | None = None
        self._unsigned = frozenset(unsigned)
        self._streams: dict[tuple[int, int, int], int] = {}
        self._floor = 0
        self._began = False

    def present(self, unix: int) -> None:
        """It is ``unix`` (µs); who does not know the time may count from anywhere before 2015. From the first
        call on nothing counts on a new stream that is older than that call: somebody may have recorded it
        for a restart."""
        stamp = (unix - EPOCH) // UNIT
        if stamp > self.newest:
            self.newest = min(stamp, LATEST)
        if not self._began:
            self._began = True
            self._floor = max(self._floor, min(stamp, LATEST))

    def resume(self, newest: int) -> None:
        """Go on after a restart: nothing up to this stamp counts or will be sent."""
        self.newest = max(self.newest, min(newest, LATEST))
        self._floor = max(self._floor, self.newest)

    def use(self, key: Key | None, since: int = 0) -> None:
        """Another key, or none, from now on; it is at least the stamp ``since``."""
        if key != self.key:
            self.key, self._floor = key, 0
            self._streams.clear()
        self.newest = max(self.newest, min(since, LATEST))

    def sign(self, frame: bytes, link: int) -> bytes:
        """``frame``, whose header says that it is signed, with its signature; ``link``: 0…255. Each stamp is
        later than the one before. Raises ValueError without a key."""
        if self.key is None:
            raise ValueError("there is no key to sign with")
        self.newest = min(self.newest + 1, LATEST)
        data = frame + bytes((link,)) + self.newest.to_bytes(6, "little")
        return data + self.key.signature(data)

    def check(self, frame: Frame) -> Refusal | None:
        """Why ``frame`` does not count; None if it does, and then it does not a second time."""
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
        # Only now: or whoever forges a stamp of tomorrow would lock out the true sender until then.
        self._remember(stream, stamp)
        self.newest = max(self.newest, stamp)
        return None

    def _remember(self, stream: tuple[int, int, int], stamp: int) -> None:
        streams = self._streams
        if stream not in streams and len(streams) >= STREAMS:
            # The one that has been silent for longest; should it speak again, it has to be later than that.
            silent = min(streams, key=streams.__getitem__)
            self._floor = max(self._floor, streams.pop(silent))
        streams[stream] = stamp
