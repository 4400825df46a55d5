"""A tlog as a link: its frames arrive at the recorded times, counted from the first receive on."""

from __future__ import annotations

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.errors import LogError
from mavlink_bridge.links.endpoints import Replay
from mavlink_bridge.links.link import BURST, LinkCounters
from mavlink_bridge.tlog.log import Record, read_tlog


class ReplayLink:
    """Link that returns each record of a log as a datagram of its own.

    Records of both directions and of all links of the log are included: a receiver must filter out its own
    messages. A record whose time steps back arrives with the previous one.

    Sent datagrams are discarded and count as dropped. The constructor raises LogError if the first record
    cannot be read; a later read error ends the log.
    """

    def __init__(self, endpoint: Replay, clock: Clock) -> None:
        self._clock = clock
        self._records = iter(read_tlog(endpoint.path))
        self._next: Record | None = next(self._records, None)
        self._lag: int | None = None
        self._received = self._dropped = 0

    @property
    def counters(self) -> LinkCounters:
        """Counts; ``sent`` is always 0."""
        return LinkCounters(self._received, 0, self._dropped)

    @property
    def over(self) -> bool:
        """Whether the end of the log has been reached."""
        return self._next is None

    def fileno(self) -> None:
        """Return None: the link must be polled."""

    def receive(self) -> list[bytes]:
        """Return the frames whose time has come, at most ``BURST``."""
        found: list[bytes] = []
        if self._next is None:
            return found
        now = self._clock.now()
        if self._lag is None:
            self._lag = now - self._next.time
        while self._next is not None and self._next.time + self._lag <= now and len(found) < BURST:
            found.append(self._next.frame)
            self._next = self._following()
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """Discard ``data``."""
        self._dropped += 1

    def close(self) -> None:
        """Stop reading."""
        self._records.close()
        self._next = None

    def _following(self) -> Record | None:
        try:
            return next(self._records, None)
        except LogError:
            return None  # a read error ends the log
