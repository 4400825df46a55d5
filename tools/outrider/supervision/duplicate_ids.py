"""Detector of another sender with the own system and component id.

Such a sender exists if two vehicles have the same system id, and so ignore each other, or if two companions
control one vehicle.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from companion.values.components import COMPONENT
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.wire.framing import leading_frames
from mavlink_bridge.wire.header import Header

REMEMBERED: Final = 4096
"""Number of sent frames kept; more than a link sends before an echo of the first one returns."""
_MIN_SPAN_US, _MAX_SILENCE_US = 2_000_000, 10_000_000
"""Times, µs.

A duplicate counts when its messages span the first time, which is longer than the transport delay of messages
of a previous companion. After the second time without messages it counts as gone.
"""


class DuplicateIds:
    """Detector of a duplicate on the links of the companion of ``system``.

    A duplicate is a sender with the companion's ids whose frames differ from each of the last
    ``REMEMBERED`` frames of the companion itself. ``clock``: wall clock.
    """

    def __init__(self, system: int, clock: Clock) -> None:
        self._own = (system, COMPONENT)
        self._clock = clock
        self._said: OrderedDict[int, None] = OrderedDict()
        """Hashes of sent frames, the latest at the end."""
        self._first: int | None = None
        self._last: int | None = None

    def said(self, data: bytes) -> None:
        """Record the frames of a sent datagram."""
        for frame in leading_frames(data)[0]:
            mark = hash(frame.data)
            # If an identical frame is sent again, its age counts from the last time.
            self._said[mark] = None
            self._said.move_to_end(mark)
            if len(self._said) > REMEMBERED:
                self._said.popitem(last=False)

    def received(self, header: Header, frame: bytes) -> None:
        """Check a received frame."""
        if (header.system, header.component) != self._own or hash(frame) in self._said:
            return
        now = self._clock.now()
        if self._first is None or self._last is None or now - self._last > _MAX_SILENCE_US:
            self._first = now
        self._last = now

    @property
    def seen(self) -> bool:
        """Whether there is a duplicate."""
        first, last = self._first, self._last
        if first is None or last is None:
            return False
        return last - first >= _MIN_SPAN_US and self._clock.now() - last <= _MAX_SILENCE_US
