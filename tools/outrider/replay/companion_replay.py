"""A companion goes through its flight again: told the same times, given what its log says that it received,
it must send what its log says that it sent, byte by byte."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import zip_longest
from typing import NamedTuple

from mavlink_bridge.node import Datagram, Node
from mavlink_bridge.tlog.log import Record
from mavlink_bridge.wire.framing import leading_frames
from mavlink_bridge.wire.header import header
from outrider.runs import names

_LINKS = {number: link for link, number in names.LINK_NUMBERS.items()}
SETPOINT = 84
"""SET_POSITION_TARGET_LOCAL_NED."""


class Sent(NamedTuple):
    """A frame, and the link that it left by."""

    link: str
    frame: bytes


class Difference(NamedTuple):
    """The first frame that is another: at ``time`` (µs); None where one side has no more at that time."""

    time: int
    logged: Sent | None
    again: Sent | None


class Reenacted(NamedTuple):
    """How it went for one vehicle. ``frames`` sent that are the same, ``setpoints`` among them; ``different``
    counts those that are not; ``stray``: records at times at which the companion was not stepped."""

    system: int
    steps: int
    frames: int
    setpoints: int
    different: int
    stray: int
    first: Difference | None

    @property
    def identical(self) -> bool:
        """Whether nothing differs."""
        return not self.different and not self.stray


def reenact(
    companion: Node,
    own: tuple[int, int],
    steps: Iterable[int],
    records: Iterable[Record],
    watch: Callable[[int], None] = lambda _time: None,
) -> Reenacted:
    """Step ``companion``, whose system and component id are ``own``, at ``steps`` (µs) with what ``records``
    has at these times; ``watch`` is told each."""
    together = _Together(records)
    count = frames = setpoints = different = 0
    first: Difference | None = None
    for now in steps:
        count += 1
        watch(now)
        at_once = together.at(now)
        inbox = [Datagram(sent.link, sent.frame) for sent in at_once if header(sent.frame)[:2] != own]
        logged = [sent for sent in at_once if header(sent.frame)[:2] == own]
        again = [
            Sent(link, frame.data)
            for link, data in companion.step(now, inbox)
            for frame in leading_frames(data)[0]
        ]
        for before, after in zip_longest(logged, again):
            if before == after:
                frames += 1
                setpoints += header(before.frame).message_id == SETPOINT
                continue
            different += 1
            first = first or Difference(now, before, after)
    return Reenacted(own[0], count, frames, setpoints, different, together.stray(), first)


class _Together:
    """Records by their time: those of one time are asked for once, in order of time."""

    def __init__(self, records: Iterable[Record]) -> None:
        self._records: Iterator[Record] = iter(records)
        self._next = next(self._records, None)
        self._stray = 0

    def at(self, now: int) -> list[Sent]:
        """All at ``now`` (µs); what was earlier and nobody asked for is stray."""
        found = []
        while self._next is not None and self._next.time <= now:
            if self._next.time == now:
                found.append(Sent(_LINKS[self._next.link], self._next.frame))
            else:
                self._stray += 1
            self._next = next(self._records, None)
        return found

    def stray(self) -> int:
        """How many nobody asked for, now that nobody asks any more."""
        left = 0 if self._next is None else 1
        self._next = None
        return self._stray + left + sum(1 for _ in self._records)
