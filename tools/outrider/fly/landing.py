"""What is said of a landing: that it came back is claimed only by what was measured."""

from __future__ import annotations

from typing import Final, NamedTuple

_THERE: Final = 1.5
"""m from its place, in the plane: estimates and touch-down take as much."""
_BESIDE: Final = 6.0
"""m: the furthest that it lands beside a place that is taken."""


class Verdict(NamedTuple):
    """``fault``: it is elsewhere than it should be, or that is not known."""

    text: str
    fault: bool


def verdict(off: float | None, *, returning: bool) -> Verdict:
    """Of a vehicle that has landed; ``off``: how far (m) from where it should have come back to, None where
    nobody knows."""
    if not returning:
        return Verdict("landed", False)
    if off is None:
        return Verdict("landed on its way back, where is not known", True)
    if off <= _THERE:
        return Verdict("landed", False)
    if off <= _BESIDE:
        return Verdict(f"landed, {off:.1f} m beside its place", False)
    return Verdict(f"landed on its way back, {off:.0f} m from its place", True)
