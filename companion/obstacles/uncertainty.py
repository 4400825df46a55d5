"""Position uncertainty of neighbours, as they report it in addition to their positions."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from companion.values.horizon import Array
from mavlink_bridge.wire.uncertainty import unpack

_VALID_US = 3_000_000
"""µs for which a report is valid; it is sent with every position while the uncertainty lasts."""
_MAX_RADIUS = 10.0
"""m; upper bound of a reported uncertainty: distances do not grow by more."""


class ReportedUncertainty:
    """Reported uncertainties, by system id; ``systems`` removes those that are too old."""

    def __init__(self) -> None:
        self._reported: dict[int, tuple[int, float]] = {}

    def receive(self, now: int, system: int, payload: bytes) -> None:
        """Receive a TUNNEL payload at ``now`` (µs): 0 ends the report. Raises PlanWireError."""
        radius = min(unpack(payload), _MAX_RADIUS)
        if radius > 0.0:
            self._reported[system] = now, radius
        else:
            self._reported.pop(system, None)

    def systems(self, now: int) -> frozenset[int]:
        """Return the systems with a valid report at ``now`` (µs)."""
        if self._reported:
            gone = [system for system, (time, _) in self._reported.items() if now - time > _VALID_US]
            for system in gone:
                del self._reported[system]
        return frozenset(self._reported)

    def radii(self, ids: Iterable[int]) -> Array:
        """Return the uncertainty (m) of each of ``ids``, (M,); 0 without a report."""
        return np.array([self._reported[system][1] if system in self._reported else 0.0 for system in ids])
