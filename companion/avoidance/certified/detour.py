"""Detour of a vehicle that makes no progress: a way round what rests, with sub-goals along it.

The deadlock turn leads around one obstacle, or several vehicles that move. It does not lead out of a pocket
of posts and of vehicles that have arrived, which with a least distance of 4.7 m (``gnss``) close gaps of 9 m.
A vehicle that makes no progress although its goal was turned in full searches a way among the discs that
posts, landed and resting vehicles cover at its height. It aims along this way until the straight line to its
goal is free. It keeps to its way while this is free, because two ways of nearly the same length would
alternate otherwise. A long search is spread over plans, in parts that do not depend on the speed of the
computer. Only the cost changes.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from itertools import pairwise

import numpy as np

from companion.avoidance.certified.visibility_graph import Discs, finding, free, without
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from companion.ways.subgoal import Subgoal

_EVERY_US, _AGAIN_US = 1_000_000, 5_000_000
"""Shortest time (µs) between two searches, and after one without a way."""
_PARTS = 12
"""Corners of which a plan works out the lines, at most: some milliseconds among eight boxes."""
_MOVED_M = 0.5
"""Distance by which the goal may move before the way is searched anew."""


class Detour:
    """Way of one vehicle within the ``limits`` of plans; ``ahead`` (m): least length up to a sub-goal."""

    def __init__(self, limits: LimitsConfig, ahead: float) -> None:
        self._low, self._high = np.array(limits.box_min[:2]), np.array(limits.box_max[:2])
        self._ahead = ahead
        self._way: Array | None = None
        self._choice = 0
        self._next_search = 0
        self._looking: Generator[None, None, tuple[int, Array] | None] | None = None
        self.begun = 0
        """Number of ways that were begun."""
        self.straight = False
        """Whether the line to the goal was free at the last call while the vehicle made no progress."""

    def towards(
        self, now: int, rest: Array, goal: Array, discs: Callable[[], Sequence[Discs]], *, stalled: bool
    ) -> Subgoal:
        """Return the sub-goal at ``now`` (µs) of a plan that ends at ``rest`` (3,) so far, towards ``goal``.

        ``stalled``: there is no progress. ``discs`` returns what a way must avoid, in order of preference.
        Without a way, the sub-goal is the goal.
        """
        self.straight = False
        # A search that has begun is ended: a way that was blocked is searched anew without a stall.
        if self._way is None and self._looking is None and not stalled:
            return Subgoal(goal, 0.0)
        choices = discs()
        here, there = rest[:2], goal[:2]
        if free(here, there[None], without(here, without(there, choices[0])))[0]:
            self._way = self._looking = None
            self.straight = stalled
            return Subgoal(goal, 0.0)
        kept = self._still_free(here, there, choices[min(self._choice, len(choices) - 1)])
        # One that leads through what rests is searched anew where there is no progress along it.
        if kept and not (self._choice and (stalled or self._looking is not None)):
            self._looking = None
        else:
            # Until the search ends the old way is followed: straight on leads back into the pocket.
            self._search(now, here, there, choices)
        return Subgoal(goal, 0.0) if self._way is None else self._along(self._way, rest, goal)

    @property
    def through(self) -> bool:
        """Whether the way leads through what rests and may leave: past all of it there was none."""
        return self._way is not None and self._choice > 0

    def forget(self) -> None:
        """Drop the way and the search of one."""
        self._way = self._looking = None
        self.straight = False

    def _search(self, now: int, here: Array, there: Array, choices: Sequence[Discs]) -> None:
        if self._looking is None:
            if now < self._next_search:
                return
            self._looking = self._first(here, there, choices)
        for _ in range(_PARTS):
            try:
                next(self._looking)
            except StopIteration as end:
                self._looking = self._way = None
                if end.value is not None:
                    self._choice, self._way = end.value
                self._next_search = now + (_AGAIN_US if self._way is None else _EVERY_US)
                self.begun += self._way is not None
                return

    def _first(
        self, here: Array, there: Array, choices: Sequence[Discs]
    ) -> Generator[None, None, tuple[int, Array] | None]:
        """Return the number of the first of ``choices`` that leave a way, and the way.

        It yields after each part.
        """
        for number, discs in enumerate(choices):
            # What stays for ever alone is another choice only where something else rests.
            if number and len(discs.radii) == len(choices[0].radii):
                continue
            found = yield from finding(here, there, discs, self._low, self._high)
            if found is not None:
                return number, found
        return None

    def _still_free(self, here: Array, there: Array, discs: Discs) -> bool:
        """Return whether the way still leads to ``there``; drop the corners that lie behind."""
        if self._way is None or np.abs(self._way[-1] - there).max() > _MOVED_M:
            return False
        discs = without(here, without(there, discs))
        seen = np.flatnonzero(free(here, self._way, discs))
        if not len(seen):
            return False
        left = self._way[seen[-1] :]
        self._way = left
        return all(free(one, two[None], discs)[0] for one, two in pairwise(left))

    def _along(self, left: Array, rest: Array, goal: Array) -> Subgoal:
        """Return the place ``ahead`` on the way that is ``left`` (k, 2), or its first corner if further."""
        corners = np.vstack([rest[:2], left])
        pieces = np.sqrt((np.diff(corners, axis=0) ** 2).sum(axis=1))
        reached = np.concatenate([[0.0], np.cumsum(pieces)])
        at = min(max(self._ahead, pieces[0]), reached[-1])
        place = np.array(
            [np.interp(at, reached, corners[:, 0]), np.interp(at, reached, corners[:, 1]), goal[2]]
        )
        return Subgoal(place, float(reached[-1] - at))
