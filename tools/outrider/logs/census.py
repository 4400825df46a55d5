"""Census of a log, as values only."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.tlog.log import TlogReport


class Gaps(NamedTuple):
    """Silences of more than ``limit`` µs: their ``number``, and the ``longest`` (µs; 0 without any)."""

    limit: int
    number: int
    longest: int


class Vehicle(NamedTuple):
    """All that was sent under one system id.

    ``kind`` and ``autopilot``: numbers of MAV_TYPE and MAV_AUTOPILOT in its last HEARTBEAT, None without one.
    Among several components, the autopilot's HEARTBEAT is used.

    ``counts``: message ids and how many of each, the most frequent first; ``versions``: of MAVLink;
    ``signed``: messages that carry a signature; ``first``, ``last``: its earliest and latest time (µs).
    """

    system: int
    components: tuple[int, ...]
    kind: int | None
    autopilot: int | None
    counts: tuple[tuple[int, int], ...]
    versions: tuple[int, ...]
    links: tuple[int, ...]
    signed: int
    first: int
    last: int
    gaps: Gaps

    @property
    def messages(self) -> int:
        """Number of messages."""
        return sum(count for _, count in self.counts)

    def rate(self, count: int) -> float:
        """Return ``count`` messages per second of the time from ``first`` to ``last``.

        It is 0 if the two times are equal.
        """
        return count / (1e-6 * (self.last - self.first)) if self.last > self.first else 0.0


class Census(NamedTuple):
    """Census of a whole log; ``vehicles`` by system id, including ground stations and payloads."""

    vehicles: tuple[Vehicle, ...]
    report: TlogReport

    @property
    def start(self) -> int:
        """The earliest time, µs."""
        return min(vehicle.first for vehicle in self.vehicles)

    @property
    def end(self) -> int:
        """The latest time, µs."""
        return max(vehicle.last for vehicle in self.vehicles)

    @property
    def signed(self) -> int:
        """Number of messages that carry a signature."""
        return sum(vehicle.signed for vehicle in self.vehicles)
