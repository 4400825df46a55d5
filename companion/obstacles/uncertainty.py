"""How far the others may be from where they say that they are, as they tell it beside their positions."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from companion.values.horizon import Array
from mavlink_bridge.wire.uncertainty import unpack

_LASTS = 3_000_000
"""µs for which what was told counts; it is told with every position while there is something to tell."""
_MOST = 10.0
"""m; nobody keeps further away because somebody says so."""


class ReportedUncertainty:
    """By system id."""

    def __init__(self) -> None:
        self._told: dict[int, tuple[int, float]] = {}

    def receive(self, now: int, system: int, payload: bytes) -> None:
        """What came in a TUNNEL at ``now`` (µs). Raises PlanWireError for what is none."""
        radius = min(unpack(payload), _MOST)
        if radius > 0.0:
            self._told[system] = now, radius
        else:
            self._told.pop(system, None)

    def systems(self, now: int) -> frozenset[int]:
        """Who may be elsewhere at ``now`` (µs)."""
        if self._told:
            gone = [system for system, (time, _) in self._told.items() if now - time > _LASTS]
            for system in gone:
                del self._told[system]
        return frozenset(self._told)

    def radii(self, ids: Iterable[int]) -> Array:
        """How far (m) each of ``ids`` may be off, (M,)."""
        return np.array([self._told[system][1] if system in self._told else 0.0 for system in ids])
