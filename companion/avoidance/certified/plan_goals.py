"""Where a plan should end: the destination, or a place that vehicles and obstacles leave free before it.

In turn: a place beside the corridors of others (``room``), a way around fixed obstacles (``ways``), a step in
a lane (``lane_goals``), a detour around what rests (``space_detour``, ``detour``), the turn of a goal that is
pushed back (``deadlock``), and the turn before encounters that are predicted (``anticipation``). All change
only the cost of a plan.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

import numpy as np

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.anticipation import NOBODY, Anticipated, Anticipation
from companion.avoidance.certified.deadlock import DeadlockTurn
from companion.avoidance.certified.detour import Detour
from companion.avoidance.certified.lane_goals import LaneGoals
from companion.avoidance.certified.margins import from_surfaces
from companion.avoidance.certified.room import Room
from companion.avoidance.certified.told_goals import ToldGoals
from companion.avoidance.certified.way_obstacles import BESIDE_M, WayObstacles
from companion.config import CompanionConfig
from companion.values.horizon import Array
from companion.values.vectors import limit
from companion.ways import space_detour_of, way_of
from companion.ways.subgoal import Subgoal
from mavlink_bridge.messages import Source
from mavlink_bridge.wire.plan import WirePlan

if TYPE_CHECKING:
    from companion.ways.space_detour import SpaceDetour

_EFFORT = 2
"""How much of a search is done for a plan."""
_MOVED_M = 0.5
"""Distance by which the end of the plan must have moved before another way counts as another one."""


class PlanGoals:
    """Goals of the plans of the vehicle ``own``.

    ``told``: the goals that the others and the own vehicle tell. ``turn``: of the goal, to the side of
    ``sense``.
    """

    def __init__(
        self,
        config: CompanionConfig,
        own: Source,
        agreements: Agreements,
        obstacles: WayObstacles,
        told: ToldGoals,
        turn: DeadlockTurn,
        sense: float,
    ) -> None:
        certified, limits = config.certified, config.limits
        self._config = config
        self._agreements, self._obstacles, self._told = agreements, obstacles, told
        self._deadlock_turn = turn
        self._detour = Detour(limits.within(config.field.margin(1)), certified.deadlock.detour)
        # A way keeps what plans keep, with some room for their planes. There are few plans: each does more.
        least = from_surfaces(certified, config.field, limits) + BESIDE_M
        self._way = way_of(config, least, _EFFORT, BESIDE_M)
        # Its search is loaded when it is prepared, so that a companion starts without it.
        self._space: SpaceDetour | None = None
        self._has_space = self._way is None and not config.planar
        self._least = least
        self._anticipation = Anticipation(config, obstacles.between, sense)
        in_lanes = config.way is not None and config.way.lanes is not None
        # In space vehicles pass over each other, in lanes they give way.
        self._anticipates = config.planar and certified.anticipation.most > 0.0 and not in_lanes
        self._lane_goals = LaneGoals(own.system, told, self._way, obstacles.between, in_use=in_lanes)
        # In lanes vehicles make room by steps, and tell their goals for that.
        self._gives_way = in_lanes
        self._room = None if in_lanes else Room(config, own.system, told, obstacles)
        self._in_lane = False
        self._began_at: Array | None = None

    @property
    def enclosed(self) -> bool:
        """Whether fixed obstacles leave no way from the end of the plan to the destination."""
        return self._way is not None and self._way.enclosed

    def prepare(self, height: float) -> None:
        """Work out what ways need at ``height`` (m), before the vehicle goes anywhere."""
        if self._way is not None:
            self._way.prepare(height)
        if self._has_space and self._space is None:
            kept, between = self._least - BESIDE_M, self._obstacles.between
            self._space = space_detour_of(self._config, kept, between, BESIDE_M)
            self._space.prepare()

    def chosen(
        self,
        now: int,
        epoch: int,
        start: WirePlan,
        own: Array,
        destination: Array,
        *,
        given: bool,
        moving: bool,
    ) -> tuple[Subgoal, Array]:
        """Return the sub-goal on the way to ``destination`` (3,), m, and where to aim for it, (3,), m.

        ``epoch``: that of ``now``, µs; ``start``: beginning of the plan; ``own`` (n, 3, 3), m: the committed
        plan, carried on. A destination that is ``moving`` is not told to others. One that is not ``given`` is
        a place to hold, or another place in the stead of a goal, which depends on where others rest: no room
        is asked for and made there.
        """
        anticipates = self._anticipates and not moving
        rest = own[-1, 2]
        room = self._room if given and not moving else None
        aim, asked = destination, None
        if room is not None:
            aim = room.destination(now, epoch, rest, destination, self._agreements.peers)
            if room.moved:
                self._deadlock_turn.restart()
        subgoal = self._subgoal(now, epoch, rest, aim)
        goal = subgoal.place
        if room is not None:
            occupied = self._deadlock_turn.stalled and self._obstacles.occupied(
                epoch, destination, self._agreements.peers
            )
            asked = room.asked(rest, goal, closed=self._closed, occupied=occupied)
        if not self._gives_way:
            tells = anticipates or asked is not None
            self._told.tell(destination if tells else None, room=asked)
        if anticipates:
            met = self._met(now, start, aim)
        else:
            self._anticipation.restart()
            met = NOBODY
        if not self._in_lane:
            place = own[0, 0]
            # A sub-goal that is turned aside is not on the way any more, and may not be free.
            met = NOBODY if subgoal.beyond > 0.0 else met
            if moving or not self._led or self._deadlock_turn.overtime:
                goal = self._deadlock_turn.turned(place, goal, met.angle)
            if met.ahead < inf:
                goal = place + limit(goal - place, met.ahead)
        return subgoal, goal

    def _subgoal(self, now: int, epoch: int, rest: Array, destination: Array) -> Subgoal:
        """Return where the plan should end: ``destination`` (3,), m, or a place on a way round to it.

        That is the way around fixed obstacles, and a detour on it around what rests.
        """
        way, stalled = self._way, self._deadlock_turn.stalled
        begun, led = self._begun(), self._led
        if way is not None and stalled:
            way.go_round(now, lambda: self._obstacles.at_rest(epoch, self._agreements.peers))
        goal = Subgoal(destination, 0.0) if way is None else way.towards(rest, destination)
        in_lane = self._lane_goals.subgoal(now, rest, destination, goal.place, self._agreements.peers.ends)
        if self._in_lane != (in_lane is not None):
            self._in_lane = in_lane is not None
            self._deadlock_turn.restart()
        if in_lane is not None:
            return in_lane
        subgoal = self._past_others(now, epoch, rest, goal.place)
        if self._straight:
            self._deadlock_turn.give_up()
        if self._begun() != begun:
            first = self._led and not led
            self._restart(rest, counts=stalled or first or (way is not None and way.goes_round))
        return Subgoal(subgoal.place, subgoal.beyond + goal.beyond)

    def _past_others(self, now: int, epoch: int, rest: Array, goal: Array) -> Subgoal:
        """Return where to aim for on a detour around what rests: in space, or in the plane if there is none.

        The plan ends at ``rest`` (3,) so far, on the way to ``goal`` (3,), m.
        """
        stalled = self._deadlock_turn.stalled
        if self._space is not None:
            subgoal = self._space.towards(
                now,
                rest,
                goal,
                lambda: self._obstacles.at_rest(epoch, self._agreements.peers),
                stands=self._deadlock_turn.stands,
                stalled=stalled,
            )
            if not self._space.enclosed:
                self._detour.forget()
                return subgoal
        return self._detour.towards(
            now,
            rest,
            goal,
            lambda: self._obstacles.resting(epoch, rest, goal, self._agreements.peers),
            stalled=stalled,
        )

    @property
    def _led(self) -> bool:
        """Whether a way in space to the present goal has been found."""
        return self._space is not None and self._space.led

    @property
    def _straight(self) -> bool:
        """Whether the line to the goal, or to the next place of the way, is free without progress."""
        return self._detour.straight or (self._space is not None and self._space.straight)

    @property
    def _closed(self) -> bool:
        """Whether those that rest leave no way to the goal."""
        narrow = self._space is not None and self._space.narrow
        return narrow or self._detour.through or (self._way is not None and self._way.closed)

    def _begun(self) -> tuple[int, int]:
        """Return how many detours and how many ways around fixed obstacles were begun."""
        space, way = self._space, self._way
        return self._detour.begun + (0 if space is None else space.begun), 0 if way is None else way.begun

    def _restart(self, rest: Array, *, counts: bool) -> None:
        """Measure progress anew on another way from ``rest`` (3,), m.

        Where a way is lost and found again at the same place, as at a corner of an obstacle beside which
        somebody rests, or in a gap that opens and closes, that is no progress. It ``counts`` in any case if
        it was searched because there was none, or is the first in space to its goal.
        """
        if counts or self._began_at is None or float(np.abs(rest - self._began_at).max()) > _MOVED_M:
            self._began_at = rest.copy()
            self._deadlock_turn.restart()

    def _met(self, now: int, start: WirePlan, goal: Array) -> Anticipated:
        """Return how to avoid encounters on the way from the ``start`` of the plan to ``goal`` (3,), m.

        The others are where their newest plans are when this one begins.
        """
        begins, plans, told = start.epoch, self._agreements.peers.newest(), self._told.recent(now)
        met = [system for system in sorted(told) if system in plans]
        places = [plans[s].later(max(begins, plans[s].plan.epoch), 1)[0, 0] for s in met]
        ways = [(place, told[system].position_m) for system, place in zip(met, places, strict=True)]
        others = np.array(ways).reshape(-1, 2, 3)
        age = self._agreements.age(begins, met)
        return self._anticipation.met(np.stack([start.position_m, goal]), others, age)
