"""Way of one vehicle to its destination where fixed obstacles block the straight way.

While the straight way to the destination is blocked, a way is searched, and the vehicle aims at the furthest
place of the way that it sees: the sub-goal moves on along the way with the vehicle. All is tried with the
largest clearance first: a way with more room is preferred to a shorter one. A search is spread over plans, in
parts that do not depend on the speed of the computer. Until it ends, the vehicle aims along the way that it
has, and without one at the destination, as it does where there is no way.

Others may rest where a way leads, in gaps that are too narrow then. A vehicle that makes no progress along
its way searches another one that passes them, too, and keeps the one it had if there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from math import inf

import numpy as np

from companion.config.obstacles import Obstacle
from companion.config.planning import LimitsConfig
from companion.config.way import WayConfig
from companion.values.horizon import Array
from companion.ways.balls import Balls
from companion.ways.clearance import Clearance, clearance_of
from companion.ways.finding import Found, finding
from companion.ways.followed import Followed
from companion.ways.lanes import Lanes
from companion.ways.subgoal import Subgoal

_SHARES = (1.0, 0.5, 0.0)
"""Shares of ``way.clearance`` that are tried beyond the least distance."""
_SEEN = 0.85
"""Share of the clearance of a way with which its places are seen from a vehicle beside the way."""
_MOVED_M = 0.5
"""Distance by which the destination or the vehicle must have moved before a search is repeated."""
_JUMP_M = 2.0
"""Distance from which on the destination is another one: from where it would be if it moved on as before."""
_AGAIN_US = 5_000_000
"""Shortest time (µs) between two searches of a way past others that rest."""
_AT_REST: Array = np.zeros(3)


class Way:
    """Way of one vehicle around ``obstacles``, within ``limits``.

    ``least`` (m): clearance that a way must have. ``planar``: it stays at the height of the first place.
    ``parts``: how many parts of a search are done for each plan. ``spare`` (m): part of ``least`` that plans
    need not keep.
    """

    def __init__(
        self,
        config: WayConfig,
        obstacles: Sequence[Obstacle],
        limits: LimitsConfig,
        least: float,
        parts: int,
        *,
        planar: bool = False,
        spare: float = 0.0,
    ) -> None:
        self._config, self._obstacles, self._limits = config, tuple(obstacles), limits
        self._clearances = [least + share * config.clearance for share in _SHARES]
        self._parts, self._level, self._planned = parts, np.nan, not planar
        self._kept = least - spare
        # The clearances of a box take a tenth of a second or more: not in flight.
        self._clear = None if planar else self._clearance(None)
        self._followed: Followed | None = None
        self._lower: tuple[int, Array] | None = None
        self._search: Generator[None, None, Found | None] | None = None
        self._ends: tuple[Array, Array] | None = None
        self._goal: Array | None = None
        self._step = _AT_REST
        self._lanes: Lanes | None = None
        self._among: Clearance | None = None
        self._next_round = 0
        self._floor = -inf
        self.begun = 0
        """Number of ways that were begun."""
        self.enclosed = False
        """Whether there is no way to the destination."""
        self.closed = False
        """Whether others that rest leave no way, as far as was searched."""
        self.clear = False
        """Whether no fixed obstacle is between the vehicle and the sub-goal that it was last given."""

    def forget(self) -> None:
        """Drop the way and the search of one, because the next destination is another one."""
        self._followed = self._search = self._ends = self._lower = self._goal = self._among = None
        self._step, self.enclosed, self.closed = _AT_REST, False, False

    def keep_above(self, floor: float) -> None:
        """Search ways at the height ``floor`` (m) or above from now on; the present one is dropped."""
        if floor != self._floor:
            self._floor = floor
            self.forget()

    def go_round(self, now: int, others: Callable[[], Balls]) -> None:
        """Search another way past ``others``, which rest, because no progress is made; ``now`` in µs.

        Not again within 5 s. If there is none, a way among fixed obstacles alone is searched again.
        """
        if self._clear is None or now < self._next_round:
            return
        self._next_round = now + _AGAIN_US
        self._among = self._clear.among(others())
        self._followed = self._search = self._ends = self._lower = None

    @property
    def goes_round(self) -> bool:
        """Whether the way that is followed or searched passes others that rest."""
        return self._among is not None

    def prepare(self, height: float) -> None:
        """Work out the clearances and the lanes at ``height`` (m) of a planar vehicle, before it plans there.

        They take a tenth of a second or more. The first plan does it if it is at another height.
        """
        if not self._planned:
            self._clear_at(height)
            self.lanes()

    def towards(self, place: Array, goal: Array) -> Subgoal:
        """Return the sub-goal of a plan that is made now, from ``place`` (3,) towards ``goal`` (3,), m.

        Call it once for each plan. Without a way, or where the straight way is free, it is the goal. From a
        destination that jumps no way and no search is kept.
        """
        if self._goal is not None:
            step = goal - self._goal
            if float(np.abs(step - self._step).max()) > _JUMP_M:
                self.forget()
            self._step = step
        self._goal = goal
        fixed = self._clear_at(float(place[2]))
        clear = fixed if self._among is None else self._among
        self._planned = True
        height = float(goal[2])
        here, there = place, goal
        if self._level == self._level:
            here, there = (np.array([x, y, self._level]) for x, y in (place[:2], goal[:2]))
        if self._straight(clear, here, there):
            self._followed = self._search = self._ends = self._among = None
            self.enclosed, self.closed, self.clear = False, False, True
            return Subgoal(goal, 0.0)
        before = self._followed
        seen = self._follows(clear, here, there)
        if seen:
            self._search = None
        else:
            self._go_on(clear, here, there)
        # A new way begins where the vehicle is.
        self.clear = seen or (self._followed is not None and self._followed is not before)
        if self._followed is None:
            return Subgoal(goal, 0.0)
        subgoal = self._followed.subgoal()
        if self._level == self._level:
            subgoal.place[2] = height
        return subgoal

    def lanes(self) -> Lanes | None:
        """Return the lanes at the height of a planar vehicle; None without ``way.lanes``, and at first."""
        clear, apart = self._clear, self._config.lanes
        if self._lanes is None and clear is not None and apart is not None and self._level == self._level:
            self._lanes = Lanes(clear, self._clearances[-1], apart, self._kept)
        return self._lanes

    def _clear_at(self, height: float) -> Clearance:
        """Return the clearances; those of a planar vehicle are at the ``height`` (m) of its first plan."""
        if self._clear is None or not (self._planned or height == self._level):
            self._level, self._lanes, self._among = height, None, None
            self._clear = self._clearance(height)
        return self._clear

    def _clearance(self, level: float | None) -> Clearance:
        """Return the clearances in the box, or at a ``level`` (m)."""
        cell, most = self._config.cell, self._config.most_cells
        return clearance_of(self._obstacles, self._limits, cell, most, self._clearances[0], level)

    def _straight(self, clear: Clearance, place: Array, goal: Array) -> bool:
        """Return whether the straight way is free, with the clearance of the last way to ``goal``."""
        if clear.sees(place, goal, self._clearances[0]):
            return True
        if self._lower is None:
            return False
        level, found_for = self._lower
        if float(np.abs(found_for - goal).max()) > _MOVED_M:
            self._lower = None
            return False
        return clear.sees(place, goal, self._clearances[level])

    def _follows(self, clear: Clearance, place: Array, goal: Array) -> bool:
        """Return whether a way leads to ``goal`` and is seen from ``place``; move its sub-goal."""
        followed = self._followed
        if followed is None:
            return False
        wanted = _SEEN * self._clearances[followed.level]
        leads = followed.leads_to(clear, goal, wanted)
        moved = float(np.abs(followed.corners[-1] - goal).max())
        return followed.look(clear, place, wanted) and (leads or moved < _MOVED_M)

    def _go_on(self, clear: Clearance, place: Array, goal: Array) -> None:
        """Search a way from ``place`` to ``goal``, if one of them has moved since there was none."""
        if self._search is None:
            if self.enclosed and self._ends is not None:
                pairs = zip(self._ends, (place, goal), strict=True)
                if max(float(np.abs(old - new).max()) for old, new in pairs) < _MOVED_M:
                    return
            self._ends = place, goal
            self._search = finding(clear, self._clearances, place, goal, self._floor)
        for _ in range(self._parts):
            try:
                next(self._search)
            except StopIteration as end:
                self._search = None
                self._take(clear, end.value, place, goal)
                return

    def _take(self, clear: Clearance, found: Found | None, place: Array, goal: Array) -> None:
        """Follow the way that was ``found``; where others leave none there may be one without them."""
        alone = self._among is None
        self.enclosed = alone and found is None
        self._followed = self._lower = None
        if found is None:
            if not alone:
                self._among = self._ends = None
                self.closed = True
            return
        self.closed &= alone
        self.begun += 1
        self._lower = (found.level, goal) if found.level else None
        self._followed = Followed(found.corners, found.level)
        self._followed.look(clear, place, _SEEN * self._clearances[found.level])
