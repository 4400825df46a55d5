"""Way that a vehicle follows: its corners, the places between them, and the place to aim for now."""

from __future__ import annotations

import numpy as np

from companion.values.horizon import Array
from companion.ways.clearance import Clearance
from companion.ways.corners import along, lengths
from companion.ways.subgoal import Subgoal

_AHEAD_M = 15.0
"""m. No place further away is a sub-goal: a plan ends before it."""
_LOOKS, _STEP = 6, 4
"""Places at which a plan looks, at most, and how many places they are apart."""
_SAME_M = 1e-6


class Followed:
    """Way over ``corners`` (k, 3), m, with the clearance of index ``level``."""

    def __init__(self, corners: Array, level: int) -> None:
        self.level = level
        self._at = 0
        self._take(corners)

    def _take(self, corners: Array) -> None:
        self.corners = corners
        self._places = along(corners)
        self._reached = lengths(self._places)
        self._at = min(self._at, len(self._places) - 1)

    def subgoal(self) -> Subgoal:
        """Return the place to aim for now."""
        return Subgoal(self._places[self._at].copy(), float(self._reached[-1] - self._reached[self._at]))

    def leads_to(self, clear: Clearance, goal: Array, clearance: float) -> bool:
        """Let the way end at ``goal`` (3,), m, straight from the last of its corners that sees it.

        Returns False, and keeps the end, if none sees it with the ``clearance`` (m).
        """
        if float(np.abs(self.corners[-1] - goal).max()) < _SAME_M:
            return True
        for last in range(len(self.corners) - 2, -1, -1):
            if clear.sees(self.corners[last], goal, clearance):
                self._take(np.vstack([self.corners[: last + 1], goal]))
                return True
        return False

    def look(self, clear: Clearance, place: Array, clearance: float) -> bool:
        """Move the sub-goal on to about the furthest place seen from ``place`` (3,), m.

        If it is not seen itself, it moves back instead. Returns False if no place was seen with the
        ``clearance`` (m).
        """
        last, at, step = len(self._places) - 1, self._at, _STEP
        seen = back = False
        for _ in range(_LOOKS):
            if clear.sees(place, self._places[at], clearance):
                self._at, seen = at, True
                off = self._places[at] - place
                if back or at == last or float(off @ off) > _AHEAD_M**2:
                    break
                at = min(at + step, last)
            elif seen and step > 1:
                # Behind a bend the furthest place seen may be less than a whole step away.
                step //= 2
                at = min(self._at + step, last)
            elif seen or at == 0:
                break
            else:
                back, at = True, max(at - _STEP, 0)
                self._at = at
        return seen
