"""Measurement of the link from one other companion, by its probes and by round trips."""

from __future__ import annotations

from statistics import median
from typing import Final, NamedTuple

from mavlink_bridge.wire.preflight import MOST, LinkReport, Probe

_MOST_PROBES: Final = 200_000
"""Largest number of probes that are remembered: a flood of invented ones must not fill the memory."""
_SILENT_US: Final = 2_000_000
"""Time (µs) since its last probe after which a vehicle is not heard any more."""
_JITTER_SHARE: Final = 0.95


class LinkFigure(NamedTuple):
    """``loss`` (0…1), ``jitter`` and median ``round_trip`` (µs; None: unknown) of a link."""

    loss: float
    jitter: int
    round_trip: int | None

    def report(self, peer: int) -> LinkReport:
        """Return the figure in the units of the wire."""
        round_trip = None if self.round_trip is None else min(self.round_trip // 100, MOST)
        return LinkReport(peer, round(1e4 * self.loss), min(self.jitter // 100, MOST), round_trip)


class LinkMeter:
    """Link from one vehicle, whose probes are sent every ``period`` (µs).

    ``fingerprint``: of its settings, None before a probe. ``doubled``: two processes send probes with its id.
    """

    def __init__(self, period: int) -> None:
        self._period = period
        self.fingerprint: int | None = None
        self.doubled = False
        self._run: int | None = None
        self._earlier: set[int] = set()
        self._last: int | None = None
        self._transits: dict[int, int] = {}
        self._round_trips: list[int] = []

    def receive(self, now: int, probe: Probe) -> None:
        """Receive a probe at ``now`` (µs). Another process of the same vehicle begins anew."""
        if probe.run != self._run:
            if probe.run in self._earlier:
                # A process that was restarted would not be heard again.
                self.doubled = True
            if self._run is not None and len(self._earlier) < _MOST_PROBES:
                self._earlier.add(self._run)
            self._run = probe.run
            self.begin()
        self.fingerprint, self._last = probe.fingerprint, now
        if probe.sequence not in self._transits and len(self._transits) < _MOST_PROBES:
            self._transits[probe.sequence] = now - probe.time

    def add_round_trip(self, duration: int) -> None:
        """Add the ``duration`` (µs) from a request to its reply."""
        if len(self._round_trips) < _MOST_PROBES:
            self._round_trips.append(duration)

    def begin(self) -> None:
        """Begin to measure."""
        self._transits.clear()
        self._round_trips.clear()

    def heard(self, now: int) -> bool:
        """Return whether a probe was received in the last two seconds before ``now`` (µs)."""
        return self._last is not None and now - self._last < _SILENT_US

    def figure(self, now: int) -> LinkFigure:
        """Return the figure at ``now`` (µs); a link that has fallen silent loses all that was due since.

        Delays of single messages compare two clocks, so only their differences count.
        """
        if not self._transits or self._last is None:
            return LinkFigure(1.0, 0, None)
        first, last = min(self._transits), max(self._transits)
        silent = (now - self._last) // self._period if now - self._last >= _SILENT_US else 0
        expected = last - first + 1 + silent
        transits = sorted(self._transits.values())
        late = transits[min(int(_JITTER_SHARE * len(transits)), len(transits) - 1)]
        round_trip = round(median(self._round_trips)) if self._round_trips else None
        return LinkFigure(1.0 - len(transits) / expected, late - transits[0], round_trip)
