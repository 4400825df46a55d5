"""Replay of one companion from its log.

The companion is stepped at the recorded times with the recorded input. It must send what its log contains,
byte by byte.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import zip_longest
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.node import Datagram, Node
from mavlink_bridge.tlog.log import Record
from mavlink_bridge.wire.framing import leading_frames
from mavlink_bridge.wire.header import header
from outrider.runs import names

_LINKS = {number: link for link, number in names.LINK_NUMBERS.items()}


class LinkFrame(NamedTuple):
    """Frame, and its link."""

    link: str
    frame: bytes


class Difference(NamedTuple):
    """First frame that differs, at ``time`` (µs); None where one side has no more frames at that time."""

    time: int
    logged: LinkFrame | None
    replayed: LinkFrame | None


class Replayed(NamedTuple):
    """Result for one vehicle.

    ``frames`` counts equal frames, ``setpoints`` the set-points among them, ``different`` the pairs (the k-th
    logged and the k-th replayed frame of a step) that differ, or of which one is missing. ``stray``: records
    at times at which the companion was not stepped.
    """

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


def replay_companion(
    companion: Node,
    own: tuple[int, int],
    steps: Iterable[int],
    records: Iterable[Record],
    watch: Callable[[int], None] = lambda _time: None,
) -> Replayed:
    """Step ``companion`` at the times ``steps`` (µs) and compare its output with the log.

    ``steps`` and ``records`` are in the order of time. Records of other senders are the input of the step at
    their time; those of the companion are compared with its output, frame by frame. ``own`` is its system
    and component id; ``watch`` receives the time of each step.
    """
    together = _Grouped(records)
    count = frames = setpoints = different = 0
    first: Difference | None = None
    for now in steps:
        count += 1
        watch(now)
        at_once = together.at(now)
        inbox = [Datagram(sent.link, sent.frame) for sent in at_once if header(sent.frame)[:2] != own]
        logged = [sent for sent in at_once if header(sent.frame)[:2] == own]
        replayed = [
            LinkFrame(link, frame.data)
            for link, data in companion.step(now, inbox)
            for frame in leading_frames(data)[0]
        ]
        for before, after in zip_longest(logged, replayed):
            if before == after:
                frames += 1
                setpoints += (
                    header(before.frame).message_id == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
                )
                continue
            different += 1
            first = first or Difference(now, before, after)
    return Replayed(own[0], count, frames, setpoints, different, together.stray(), first)


class _Grouped:
    """Records grouped by time; each time is requested once, in increasing order."""

    def __init__(self, records: Iterable[Record]) -> None:
        self._records: Iterator[Record] = iter(records)
        self._next = next(self._records, None)
        self._stray = 0

    def at(self, now: int) -> list[LinkFrame]:
        """Return all records at ``now`` (µs); earlier ones that were not requested count as stray."""
        found = []
        while self._next is not None and self._next.time <= now:
            if self._next.time == now:
                found.append(LinkFrame(_LINKS[self._next.link], self._next.frame))
            else:
                self._stray += 1
            self._next = next(self._records, None)
        return found

    def stray(self) -> int:
        """Return the number of records that were not requested; call it last."""
        left = 0 if self._next is None else 1
        self._next = None
        return self._stray + left + sum(1 for _ in self._records)
