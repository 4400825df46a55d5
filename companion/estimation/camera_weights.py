"""Weights of the fleet's cameras as measured, by the detections that count.

A camera that sees less than the others counts less, one that sees nothing not at all. Lost messages are no
sign of that, and are told from it by the positions that the same companion sends: a vehicle's detections
are counted over the time in which as many of its positions arrived as it sends in a base span, and compared
by their number per position that arrived. Companions are assumed to send at the same rates. Of a vehicle
without positions the detections of the base span count.
"""

from __future__ import annotations

from collections import deque

from companion.config import CompanionConfig
from companion.estimation.fusion import Fusion, Seen
from mavlink_bridge.messages import Source

_SPAN_US, _LONGEST_US = 2_000_000, 16_000_000
"""Least and longest time (µs) over which a camera's detections are counted."""
_EVIDENCE = 10
"""Number of positions and of detections that are sent in a base span, at least."""
_MOST = 8
"""Times as many positions as are sent in a base span are kept at most."""
_ENOUGH = 0.5
"""A camera with this share of the detections of the best one counts in full, one with fewer in proportion."""


class CameraWeights:
    """Weights of the cameras, for the companion of ``system``; ``latency``: usual age (µs) of an image."""

    def __init__(self, config: CompanionConfig, system: int, latency: int) -> None:
        rates = config.rates
        self._system, self._latency, self._period = system, latency, rates.state_us
        span = max(_SPAN_US, _EVIDENCE * max(rates.state_us, rates.detection_us))
        self._span = min(span, _LONGEST_US)
        self._enough = max(self._span // self._period, 1)
        # Arrival times (µs) of positions, and the last stamp, by sender.
        self._positions: dict[Source, deque[int]] = {}
        self._stamps: dict[Source, int] = {}
        self._sources: dict[int, Source] = {}

    def heard(self, now: int, source: Source, stamp: int) -> None:
        """Receive that a position of ``source`` with ``stamp`` arrived at ``now`` (µs).

        A repeated one does not count.
        """
        if stamp and self._stamps.get(source) == stamp:
            return
        self._stamps[source] = stamp
        arrived = self._positions.setdefault(source, deque(maxlen=_MOST * self._enough))
        arrived.append(now)
        # All of the base span are kept, and so many that it may be longer.
        while len(arrived) > self._enough and arrived[0] <= now - self._span:
            arrived.popleft()

    def saw(self, source: Source) -> None:
        """Receive that a detection of ``source`` counts."""
        self._sources[source.system] = source

    def measured(self, now: int, fusion: Fusion) -> dict[int, float]:
        """Return w_k (1/m²) at ``now`` (µs) by system, of the vehicles that see; empty if none does."""
        spans: dict[int, dict[int, Seen]] = {}
        found: dict[int, tuple[float, float]] = {}
        for system, source in self._sources.items():
            span, positions = self._counted(now, source)
            if span not in spans:
                spans[span] = fusion.recent(now - span - self._latency)
            seen = spans[span].get(system)
            if seen is not None:
                found[system] = seen.number / positions, seen.weight
        weights = {}
        for system, (rate, weight) in found.items():
            # Messages of neighbours are lost, none of the own: a camera is compared with others.
            best = max(
                (one for other, (one, _) in found.items() if other not in (system, self._system)), default=0.0
            )
            weights[system] = weight if rate >= _ENOUGH * best else weight * rate / (_ENOUGH * best)
        return weights

    def _counted(self, now: int, source: Source) -> tuple[int, float]:
        """Return the time (µs) over which the detections of ``source`` count, and the positions in it."""
        arrived = self._positions.get(source, ())
        recent = [time for time in arrived if time > now - _LONGEST_US]
        if source.system == self._system or not recent:
            return self._span, self._span / self._period
        if len(recent) < self._enough:
            return _LONGEST_US, len(recent)
        span = max(self._span, now - recent[-self._enough] + 1)
        return span, sum(time > now - span for time in recent)
