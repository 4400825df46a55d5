"""Detector of another sender with the own system and component id.

Such a sender exists if two vehicles have the same system id, and so ignore each other, or if two companions
control one vehicle.

With a key only frames that it signed count: anyone may send the own ids in an unsigned frame, or send frames
again that were recorded. Signed frames with stamps from before the start are either recordings or those of a
duplicate whose clock is behind; nothing in them tells which. So they do not count. Where their stamps advance
with time, as those of a running companion do, they are reported (``behind``).
"""

from __future__ import annotations

import hmac
from collections import OrderedDict
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.key import Key
from mavlink_bridge.wire.framing import leading_frames
from mavlink_bridge.wire.header import Header
from mavlink_bridge.wire.signing import EPOCH, UNIT

REMEMBERED: Final = 4096
"""Number of sent frames kept; more than a link sends before an echo of the first one returns."""
_MIN_SPAN_US, _MAX_SILENCE_US = 2_000_000, 10_000_000
"""Times, µs.

A duplicate counts when its messages span the first time, which is longer than the transport delay of messages
of a previous companion. After the second time without messages it counts as gone.
"""


_MIN_ADVANCE: Final = 0.5
"""Least advance of old stamps, as a share of the time in which their frames arrive."""


class _Old(NamedTuple):
    """Signed frames with old stamps: times (µs) of the first and the last, and their stamps (10 µs)."""

    first: int
    last: int
    began: int
    stamp: int


class DuplicateIds:
    """Detector of a duplicate on the links of the companion of ``system``.

    A duplicate is a sender with the companion's ids whose frames differ from each of the last
    ``REMEMBERED`` frames of the companion itself. ``clock``: wall clock. With a ``key`` the frame must be
    signed with it, and its stamp later than the start and than any frame that is no longer remembered:
    earlier ones may be recordings of the companion itself.
    """

    def __init__(self, system: int, clock: Clock, key: Key | None = None) -> None:
        self._own = (system, COMPONENT)
        self._clock, self._key = clock, key
        self._said: OrderedDict[int, int] = OrderedDict()
        """Stamps of sent frames by their hashes, the latest at the end."""
        self._floor = (clock.now() - EPOCH) // UNIT
        """Stamp up to which signed frames may be recordings."""
        self._first: int | None = None
        self._last: int | None = None
        self._behind: _Old | None = None

    def said(self, data: bytes) -> None:
        """Record the frames of a sent datagram."""
        for frame in leading_frames(data)[0]:
            mark = hash(frame.data)
            # If an identical frame is sent again, its age counts from the last time.
            self._said[mark] = _stamp(frame.data) if self._key is not None and frame.signed else 0
            self._said.move_to_end(mark)
            if len(self._said) > REMEMBERED:
                self._floor = max(self._floor, self._said.popitem(last=False)[1])

    def received(self, header: Header, frame: bytes) -> None:
        """Check a received frame."""
        if (header.system, header.component) != self._own or hash(frame) in self._said:
            return
        now = self._clock.now()
        if self._key is not None:
            if not _signed(frame, self._key):
                return
            if (stamp := _stamp(frame)) <= self._floor:
                self._note_old(now, stamp)
                return
        if self._first is None or self._last is None or now - self._last > _MAX_SILENCE_US:
            self._first = now
        self._last = now

    def _note_old(self, now: int, stamp: int) -> None:
        """Note a signed frame whose stamp is not later than the start."""
        old = self._behind
        if old is None or stamp <= old.stamp or now - old.last > _MAX_SILENCE_US:
            self._behind = old = _Old(now, now, stamp, stamp)
        self._behind = old._replace(last=now, stamp=stamp)

    @property
    def seen(self) -> bool:
        """Whether there is a duplicate."""
        first, last = self._first, self._last
        if first is None or last is None:
            return False
        return last - first >= _MIN_SPAN_US and self._clock.now() - last <= _MAX_SILENCE_US

    @property
    def behind(self) -> bool:
        """Whether there are signed frames with old stamps that advance with time."""
        old = self._behind
        if old is None or self._clock.now() - old.last > _MAX_SILENCE_US:
            return False
        span = old.last - old.first
        return span >= _MIN_SPAN_US and (old.stamp - old.began) * UNIT >= _MIN_ADVANCE * span


def _signed(frame: bytes, key: Key) -> bool:
    """Return whether ``frame`` is signed with ``key``."""
    if frame[0] != mavlink.PROTOCOL_MARKER_V2 or not frame[2] & mavlink.MAVLINK_IFLAG_SIGNED:
        return False
    return hmac.compare_digest(key.signature(frame[:-6]), frame[-6:])


def _stamp(frame: bytes) -> int:
    """Return the time stamp of a signed ``frame``, in 10 µs since 2015."""
    return int.from_bytes(frame[-12:-6], "little")
