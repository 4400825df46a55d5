"""Detour in space: a way past others that rest, over and under them, for a vehicle whose plan stands.

Vehicles that have arrived may stand around the place where another one waits, or around its goal, with room
between them in space only. Then a vehicle whose plan has ended at one place for some time searches the
shortest way on a grid of the box, past others that rest and past fixed obstacles, with less and less room.
While the rest of the way is free of those that rest, it aims at about the furthest place of it that the end
of its plan sees, until it sees the goal. A search is spread over plans, in parts that do not depend on the
speed of the computer. Where two vehicles rest on the ways of each other, each goes round the other one on its
own way. Only the cost of plans changes.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from math import dist, inf

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Obstacle
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from companion.ways.balls import Balls
from companion.ways.clearance import Clearance, clearance_of
from companion.ways.corners import along, lengths
from companion.ways.finding import Found, finding
from companion.ways.subgoal import Subgoal

_EVERY_US, _AGAIN_US = 1_000_000, 5_000_000
"""Shortest time (µs) between two searches, and after one without a way."""
_MOVED_M = 0.5
"""Distance by which the goal may move before the way is searched anew."""
_PARTS = 12
"""Parts of a search that a plan does, of some tenths of a millisecond; the last one may take longer."""
_LOOKED = 40
"""Number of the next places on a way that a plan looks at."""
_ACROSS, _MOST_CELLS = 6.0, 150_000
"""Cells that the least distance from others spans, and how many cells there are at most."""
_BETWEEN = 0.25
"""Distance of places on a way that are aimed at, as a share of the least distance from others."""
_NARROW = 0.2
"""Share of ``spare`` with which a way is searched where there is none with all of it."""
_SEEN = 0.1
"""Share of ``spare`` that a way must keep while it is followed: others move a little."""
_GAIN_M, _STUCK_US = 0.25, 5_000_000
"""Least gain of length on ways, and the time (µs) without one after which they count as too narrow."""


class _Progress:
    """Progress of one vehicle on its ways to one goal.

    Ways that are begun within ``near`` (m) of each other count as one: each begins where the last one was
    lost. ``waited``: time (µs) with plans since the way last became shorter.
    """

    def __init__(self, near: float) -> None:
        self._near = near
        self._begun_at: Array | None = None
        self._shortest = inf
        self._noted_at = self.waited = 0

    def note(self, now: int, rest: Array, left: float) -> None:
        """Note at ``now`` (µs) a plan that ends at ``rest`` (3,), m; ``left`` (m): the length of its way."""
        if self._begun_at is None or dist(rest, self._begun_at) > self._near:
            self._begun_at, self._shortest = rest.copy(), inf
        if left < self._shortest - _GAIN_M:
            self._shortest, self.waited = left, 0
        else:
            # Time without plans is no time without progress.
            self.waited += min(now - self._noted_at, _EVERY_US)
        self._noted_at = now


class SpaceDetour:
    """Way of one vehicle past others, among ``obstacles`` within ``limits``.

    ``kept`` (m): what plans keep from fixed obstacles; ``between`` (m): from others. ``spare`` (m): wanted
    beyond these distances.
    """

    def __init__(
        self, obstacles: Sequence[Obstacle], limits: LimitsConfig, kept: float, between: float, spare: float
    ) -> None:
        self._obstacles, self._limits = tuple(obstacles), limits
        self._kept, self._spare = kept, spare
        self._clearances = (kept + spare, kept + _NARROW * spare)
        self._between, self._cell, self._spacing = between, between / _ACROSS, _BETWEEN * between
        self._clear: Clearance | None = None
        self._way: Array | None = None
        self._goal: Array | None = None
        self._search: Generator[None, None, Found | None] | None = None
        self._next_search = 0
        self.enclosed = False
        """Whether the last search found no way."""
        self._led_to: Array | None = None
        self.begun = 0
        """Number of ways that were begun."""
        self.straight = False
        """Whether the line to the goal was free at the last call while the vehicle made no progress."""
        self._progress = _Progress(between)

    def prepare(self) -> None:
        """Work out the clearances of fixed obstacles, which take a tenth of a second or more with many."""
        if self._clear is None:
            self._clear = clearance_of(
                self._obstacles, self._limits, self._cell, _MOST_CELLS, self._clearances[0]
            )

    @property
    def led(self) -> bool:
        """Whether a way to the present goal has been found.

        It stays True when the line to the goal is free again, because a turn there may lead the vehicle back.
        """
        goal, to = self._goal, self._led_to
        return goal is not None and to is not None and not _moved(to, goal)

    @property
    def narrow(self) -> bool:
        """Whether the vehicle has not got on for some time on ways that were found.

        Near its ends a way may be nearer to others than plans: no plan passes a gap that is too narrow by a
        few centimetres, and a vehicle that waits in it finds a way through it again and again.
        """
        return self._progress.waited > _STUCK_US

    def towards(
        self,
        now: int,
        rest: Array,
        goal: Array,
        others: Callable[[], Balls],
        *,
        stands: bool,
        stalled: bool,
    ) -> Subgoal:
        """Return the sub-goal at ``now`` (µs) of a plan that ends at ``rest`` (3,) so far, towards ``goal``.

        ``stands``: it has ended there for some time. ``stalled``: there is no progress for a longer time.
        ``others`` returns those that rest. Without a way it is the goal.
        """
        self.straight = False
        if self._goal is not None and _moved(self._goal, goal):
            self._forget()
        self._goal = goal
        if self._way is None and self._search is None and not (stands or stalled or self.enclosed):
            return Subgoal(goal, 0.0)
        balls = others()
        # What a way must keep of those that rest, except where the two ends are nearer.
        kept = self._kept + _SEEN * self._spare
        least = balls._replace(radii=balls.radii + kept).without(rest).without(goal)
        if self._free(least, rest, goal[None])[0]:
            self._forget()
            self.straight = stalled
            return Subgoal(goal, 0.0)
        # A way that ends beside a goal that has moved a little does not lead there.
        ends = stalled and self._way is not None and len(self._way) == 1
        if not ends and self._follows(least, rest, goal):
            self._search = None
        else:
            # Until the search ends the old way is followed: straight on leads back to where there was none.
            self._go_on(now, rest, goal, balls)
        if self._way is None:
            return Subgoal(goal, 0.0)
        subgoal = Subgoal(self._way[0], float(lengths(self._way)[-1]))
        self._progress.note(now, rest, dist(rest, subgoal.place) + subgoal.beyond)
        return subgoal

    def _forget(self) -> None:
        """Forget the way and its search: the goal is another one, or the line to it is free."""
        self._way = self._search = None
        self._progress = _Progress(self._between)
        self.enclosed = False

    def _free(self, least: Balls, places: Array, ends: Array) -> NDArray[np.bool_]:
        """Return whether the lines from ``places`` (k, 3) or (3,) to ``ends`` (k, 3), m, are free, (k,)."""
        free = least.passed(places, ends)
        if self._obstacles and self._clear is not None:
            places = np.broadcast_to(places, ends.shape)
            for k in np.flatnonzero(free).tolist():
                free[k] = self._clear.sees(places[k], ends[k], self._kept)
        return free

    def _follows(self, least: Balls, rest: Array, goal: Array) -> bool:
        """Return whether the way still leads to ``goal`` (3,), m; drop the places that lie behind."""
        if self._way is None or _moved(self._way[-1], goal):
            return False
        seen = np.flatnonzero(self._free(least, rest, self._way[:_LOOKED]))
        if not len(seen):
            return False
        self._way = self._way[int(seen[-1]) :]
        return bool(self._free(least, self._way[:-1], self._way[1:]).all())

    def _go_on(self, now: int, rest: Array, goal: Array, balls: Balls) -> None:
        """Search a way from ``rest`` to ``goal`` (3,), m, past ``balls``."""
        if self._search is None:
            if now < self._next_search:
                return
            self.prepare()
            assert self._clear is not None
            self._search = finding(self._clear.among(balls), self._clearances, rest, goal)
        for _ in range(_PARTS):
            try:
                next(self._search)
            except StopIteration as end:
                found: Found | None = end.value
                self._search, self._way = None, None
                self._next_search = now + (_AGAIN_US if found is None else _EVERY_US)
                self.enclosed = found is None
                if found is not None:
                    self._way = along(found.corners, self._spacing)[1:]
                    self._led_to = goal
                    self.begun += 1
                return


def _moved(goal: Array, now: Array) -> bool:
    """Return whether a ``goal`` (3,), m, that is ``now`` (3,) elsewhere counts as another one."""
    return float(np.abs(now - goal).max()) > _MOVED_M
