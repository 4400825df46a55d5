"""Detector of another sender with the own ids.

Either two vehicles have one system id, and each ignores the other, or two companions have one vehicle.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from companion.values.components import COMPONENT
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.wire.framing import leading_frames
from mavlink_bridge.wire.header import Header

REMEMBERED: Final = 4096
"""Number of frames; more than a link sends until its echo is back."""
_LASTS, _FORGOTTEN = 2_000_000, 10_000_000
"""Times, µs.

A duplicate must be received over the first time, which is longer than messages of a previous companion remain
under way. After the second time without messages it counts as gone.
"""


class DuplicateIds:
    """Detector of a duplicate on the links of the companion of ``system``.

    A duplicate is a sender that has the companion's ids, and whose frames are not, byte by byte, frames that
    the companion sent itself. ``clock``: wall clock.
    """

    def __init__(self, system: int, clock: Clock) -> None:
        self._own = (system, COMPONENT)
        self._clock = clock
        self._said: OrderedDict[int, None] = OrderedDict()
        """Hashes of sent frames, the latest at the end."""
        self._first: int | None = None
        self._last: int | None = None

    def said(self, data: bytes) -> None:
        """Record frames that leave."""
        for frame in leading_frames(data)[0]:
            mark = hash(frame.data)
            # A frame that is sent again byte by byte is remembered from then on.
            self._said[mark] = None
            self._said.move_to_end(mark)
            if len(self._said) > REMEMBERED:
                self._said.popitem(last=False)

    def received(self, header: Header, frame: bytes) -> None:
        """Check a frame that arrives."""
        if (header.system, header.component) != self._own or hash(frame) in self._said:
            return
        now = self._clock.now()
        if self._first is None or self._last is None or now - self._last > _FORGOTTEN:
            self._first = now
        self._last = now

    @property
    def seen(self) -> bool:
        """Whether there is a duplicate."""
        first, last = self._first, self._last
        if first is None or last is None:
            return False
        return last - first >= _LASTS and self._clock.now() - last <= _FORGOTTEN
