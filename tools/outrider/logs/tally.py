"""Counting of messages for a census: reads each header, in memory that does not grow with the log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from itertools import islice
from pathlib import Path

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.errors import LogError
from mavlink_bridge.messages import Heartbeat
from mavlink_bridge.tlog.log import Record, TlogReader
from mavlink_bridge.wire.codec import Codec
from outrider.logs.census import Census, Gaps, Vehicle

SHORTEST_GAP = 1 << 21
"""µs, 2.1 s: a shorter silence is never a gap, because components send a HEARTBEAT every second."""
UNUSUAL = 8
"""A silence of more than this many mean intervals, rounded up to a power of two (µs), may be a gap.

It is one if it is also longer than ``SHORTEST_GAP``.
"""
_RECORDS_PER_REPORT = 1 << 12
"""Number of records between two reports of progress."""


def count(path: Path, progress: Callable[[float], None]) -> Census | None:
    """Return the census of the log at ``path``; None if it holds no complete record.

    ``progress`` is called with the share that is read. Raises LogError if the log cannot be read.
    """
    try:
        size = path.stat().st_size
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from None
    reader, tally = TlogReader(path), _Tally()
    records = iter(reader)
    while piece := list(islice(records, _RECORDS_PER_REPORT)):
        tally.add(piece)
        progress(reader.bytes_read / max(size, 1))
    vehicles = tally.vehicles()
    return Census(vehicles, reader.report) if vehicles else None


class _Stream:
    """Messages of one type from one component in one version of MAVLink."""

    __slots__ = ("count", "frame", "sender")

    def __init__(self, sender: _System) -> None:
        self.sender = sender
        self.count = 0
        self.frame = b""


class _System:
    """One system id.

    ``silences``: number of silences that may be gaps, by the exponent of the next power of two (µs), so that
    memory does not grow with the log.
    """

    __slots__ = ("before", "first", "last", "links", "longest", "signed", "silences")

    def __init__(self, time: int) -> None:
        self.before = self.first = self.last = time
        self.longest = self.signed = 0
        self.links: set[int] = set()
        self.silences: Counter[int] = Counter()

    def gaps(self, messages: int) -> Gaps:
        """Return the gaps of a system with this number of ``messages``.

        The limit is a power of two, because the silences are counted in powers of two.
        """
        usual = (self.last - self.first) // max(messages - 1, 1)
        limit = max(SHORTEST_GAP, 1 << (UNUSUAL * usual - 1).bit_length() if usual else 0)
        number = sum(many for bits, many in self.silences.items() if 1 << bits > limit)
        return Gaps(limit, number, self.longest if number else 0)


class _Tally:
    """Counter of messages.

    The key of a stream is the bytes of system, component and message id in the header: 5 in MAVLink 2, 3 in
    MAVLink 1.
    """

    def __init__(self) -> None:
        self._streams: dict[bytes, _Stream] = {}
        self._senders: dict[int, _System] = {}

    def add(self, records: Iterable[Record]) -> None:
        """Count ``records``, in the order of the log."""
        known = self._streams.get
        for time, link, frame in records:
            if frame[0] == mavlink.PROTOCOL_MARKER_V2:
                key = frame[5:10]
                signed = frame[2] == mavlink.MAVLINK_IFLAG_SIGNED
            else:
                key, signed = frame[3:6], False
            stream = known(key) or self._meet(key, time)
            stream.count += 1
            stream.frame = frame
            sender = stream.sender
            if time != sender.before:
                self._pass_time(sender, time)
            if link not in sender.links:
                sender.links.add(link)
            if signed:
                sender.signed += 1

    def _meet(self, key: bytes, time: int) -> _Stream:
        sender = self._senders.setdefault(key[0], _System(time))
        self._streams[key] = stream = _Stream(sender)
        return stream

    def _pass_time(self, sender: _System, time: int) -> None:
        silence = time - sender.before
        sender.before = time
        if time > sender.last:
            sender.last = time
        elif time < sender.first:
            sender.first = time
        if silence > SHORTEST_GAP:
            # A silence of exactly 2ⁿ µs is counted under the exponent n.
            sender.silences[(silence - 1).bit_length()] += 1
            sender.longest = max(sender.longest, silence)

    def vehicles(self) -> tuple[Vehicle, ...]:
        """Return all systems so far."""
        return tuple(self._vehicle(system) for system in sorted(self._senders))

    def _vehicle(self, system: int) -> Vehicle:
        sender = self._senders[system]
        streams = {key: stream for key, stream in self._streams.items() if key[0] == system}
        counts: Counter[int] = Counter()
        for key, stream in streams.items():
            counts[_message_id(key)] += stream.count
        beats = [
            stream.frame
            for key, stream in sorted(streams.items())
            if _message_id(key) == mavlink.MAVLINK_MSG_ID_HEARTBEAT
        ]
        beat = _representative(beats)
        return Vehicle(
            system,
            tuple(sorted({key[1] for key in streams})),
            None if beat is None else beat.type,
            None if beat is None else beat.autopilot,
            tuple(sorted(counts.items(), key=lambda one: (-one[1], one[0]))),
            tuple(sorted({1 if len(key) == 3 else 2 for key in streams})),
            tuple(sorted(sender.links)),
            sender.signed,
            sender.first,
            sender.last,
            sender.gaps(counts.total()),
        )


def _message_id(key: bytes) -> int:
    return int.from_bytes(key[2:], "little")


def _representative(frames: list[bytes]) -> Heartbeat | None:
    """Return the autopilot's heartbeat, or else that of the lowest component id; None without any."""
    beats = [message for frame in frames for message in Codec().feed(frame) if isinstance(message, Heartbeat)]
    return min(
        beats,
        key=lambda beat: (beat.autopilot == mavlink.MAV_AUTOPILOT_INVALID, beat.source.component),
        default=None,
    )
