"""Metrics for ground stations: NAMED_VALUE_FLOAT, once a second."""

from __future__ import annotations

from companion.config import CompanionConfig
from mavlink_bridge.messages import NamedValue, Source

_SECOND = 1_000_000


class Metrics:
    """Metrics of the companion ``own``.

    ``plan_ms``: the longest planning time since the last report; ``misses``: total number of plans that took
    longer than their period; ``held``: total number of times that an old plan was kept; ``target_s``: age (s)
    of the target's state, absent before the first.
    """

    def __init__(self, config: CompanionConfig, own: Source) -> None:
        certified = config.avoidance == "certified"
        self._on = config.ground_messages.values
        self._own = own
        self._period_ns = 1000 * (config.certified.epoch_us if certified else config.rates.replan_us)
        self._boot: int | None = None
        self._next = 0
        self._misses = 0
        self._longest: int | None = None

    def note(self, plan_ns: int) -> None:
        """Record the computing time ``plan_ns`` (ns) of a plan."""
        self._longest = max(self._longest or 0, plan_ns)
        self._misses += plan_ns > self._period_ns

    def due(self, now: int, held: int, target_age: int | None) -> list[NamedValue]:
        """Return the metrics if they are due at ``now`` (µs), otherwise an empty list.

        ``held``: number of times that an old plan was kept so far; ``target_age``: age (µs) of the target's
        state, None before the first.
        """
        if not self._on or now < self._next:
            return []
        if self._boot is None:
            self._boot = self._next = now
        self._next += _SECOND * (1 + (now - self._next) // _SECOND)
        found = {"misses": float(self._misses), "held": float(held)}
        if self._longest is not None:
            found["plan_ms"], self._longest = 1e-6 * self._longest, None
        if target_age is not None:
            found["target_s"] = 1e-6 * target_age
        since = now - self._boot
        return [NamedValue(self._own, since, name, value) for name, value in found.items()]
