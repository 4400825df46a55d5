"""Somebody else who speaks with the own ids: then two vehicles have one system id and none sees the other, or
two companions have one vehicle."""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from companion.values.components import COMPONENT
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.wire.framing import leading_frames
from mavlink_bridge.wire.header import Header

REMEMBERED: Final = 4096
"""Frames; more than a link says until its echo is back."""
_LASTS, _FORGOTTEN = 2_000_000, 10_000_000
"""µs over which it must be heard, longer than what a companion before this one said is on its way; and after
which it counts as gone."""


class Twin:
    """Looked for among all that is heard on the links of the companion of ``system``: what has its ids, and
    is not, byte by byte, what it said itself. ``clock``: of the wall."""

    def __init__(self, system: int, clock: Clock) -> None:
        self._own = (system, COMPONENT)
        self._clock = clock
        self._said: OrderedDict[int, None] = OrderedDict()
        """Marks, what was said last at the end."""
        self._first: int | None = None
        self._last: int | None = None

    def said(self, data: bytes) -> None:
        """Frames that leave."""
        for frame in leading_frames(data)[0]:
            mark = hash(frame.data)
            # What is said again byte by byte is remembered from then on.
            self._said[mark] = None
            self._said.move_to_end(mark)
            if len(self._said) > REMEMBERED:
                self._said.popitem(last=False)

    def heard(self, header: Header, frame: bytes) -> None:
        """A frame that arrives."""
        if (header.system, header.component) != self._own or hash(frame) in self._said:
            return
        now = self._clock.now()
        if self._first is None or self._last is None or now - self._last > _FORGOTTEN:
            self._first = now
        self._last = now

    @property
    def seen(self) -> bool:
        """Whether there is one."""
        first, last = self._first, self._last
        if first is None or last is None:
            return False
        return last - first >= _LASTS and self._clock.now() - last <= _FORGOTTEN
