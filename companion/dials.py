"""Figures that a ground station can plot: NAMED_VALUE_FLOAT, once a second."""

from __future__ import annotations

from collections.abc import Sequence

from companion.config import CompanionConfig
from mavlink_bridge.messages import NamedValue, Source

_SECOND = 1_000_000


class Dials:
    """Of the companion ``own``. ``plan_ms``: the longest plan since the last time; ``misses``: plans so far
    that took longer than their period; ``held``: times that an old plan was kept; ``target_s``: age of what
    is known of the target, absent before it is heard."""

    def __init__(self, config: CompanionConfig, own: Source) -> None:
        certified = config.avoidance == "certified"
        self._on = config.voice.values
        self._own = own
        self._period_ns = 1000 * (config.certified.epoch_us if certified else config.rates.replan_us)
        self._boot: int | None = None
        self._next = 0
        self._seen = self._misses = 0

    def due(self, now: int, plan_ns: Sequence[int], held: int, target_age: int | None) -> list[NamedValue]:
        """The figures, if it is time (µs): of stopwatch readings (ns) of all plans so far, old plans kept,
        and the target's age (µs)."""
        if not self._on or now < self._next:
            return []
        if self._boot is None:
            self._boot = self._next = now
        self._next += _SECOND * (1 + (now - self._next) // _SECOND)
        new = plan_ns[self._seen :]
        self._seen += len(new)
        self._misses += sum(reading > self._period_ns for reading in new)
        found = {"misses": float(self._misses), "held": float(held)}
        if new:
            found["plan_ms"] = 1e-6 * max(new)
        if target_age is not None:
            found["target_s"] = 1e-6 * target_age
        since = now - self._boot
        return [NamedValue(self._own, since, name, value) for name, value in found.items()]
