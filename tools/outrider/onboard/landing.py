"""Report of a landing: a returning vehicle counts as returned only if its position was measured."""

from __future__ import annotations

from typing import Final, NamedTuple

_MAX_LANDING_ERROR_M: Final = 1.5
"""Largest horizontal distance (m) from the return position that counts as landed there.

Estimation errors and drift at touch-down reach this.
"""
_MAX_DISPLACEMENT_M: Final = 6.0
"""Largest horizontal distance (m) from the return position that is no fault.

A vehicle lands beside its return position if that is occupied.
"""


class Verdict(NamedTuple):
    """Text for a landing; ``fault``: a returning vehicle is too far off, or its position is unknown."""

    text: str
    fault: bool


def verdict(off: float | None, *, returning: bool) -> Verdict:
    """Return the verdict for a landed vehicle.

    ``off``: upper bound (m) of the horizontal distance from the return position, None if unknown.
    ``returning``: whether the vehicle was on its way back; if not, any position is right.
    """
    if not returning:
        return Verdict("landed", False)
    if off is None:
        return Verdict("landed on its way back, where is not known", True)
    if off <= _MAX_LANDING_ERROR_M:
        return Verdict("landed", False)
    if off <= _MAX_DISPLACEMENT_M:
        return Verdict(f"landed, {off:.1f} m beside its place", False)
    return Verdict(f"landed on its way back, {off:.0f} m from its place", True)
