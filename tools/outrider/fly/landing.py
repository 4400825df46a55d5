"""Report of a landing: the vehicle counts as back only if the position was measured."""

from __future__ import annotations

from typing import Final, NamedTuple

_THERE: Final = 1.5
"""Largest horizontal distance from its place that counts as landed there (m).

Estimates and touch-down take as much.
"""
_BESIDE: Final = 6.0
"""Largest distance at which a vehicle lands beside a place that is taken (m)."""


class Verdict(NamedTuple):
    """Text for a landing; ``fault``: the vehicle is not where it should be, or its position is unknown."""

    text: str
    fault: bool


def verdict(off: float | None, *, returning: bool) -> Verdict:
    """Return the verdict for a landed vehicle.

    ``off`` is the distance (m) from the place to which it should have returned, None where it is unknown.
    ``returning``: whether it was on its way back.
    """
    if not returning:
        return Verdict("landed", False)
    if off is None:
        return Verdict("landed on its way back, where is not known", True)
    if off <= _THERE:
        return Verdict("landed", False)
    if off <= _BESIDE:
        return Verdict(f"landed, {off:.1f} m beside its place", False)
    return Verdict(f"landed on its way back, {off:.0f} m from its place", True)
