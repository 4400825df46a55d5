"""Planner of one vehicle, as an object that its caller steps with arrays."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from itertools import count
from typing import TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from companion.avoidance.field.methods import Method
from companion.config import CompanionConfig
from companion.planning.avoidance import Avoidance
from companion.planning.certified import CertifiedAvoidance, VehicleParts
from companion.planning.field import FieldAvoidance
from companion.planning.plan_times import PlanTimes
from companion.planning.planning import Planning
from companion.values.bearings import bearing
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from companion.world import View, World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source
from mavlink_bridge.wire.codec import Codec
from outrider.arguments import checked, number, system_id
from outrider.errors import InputError
from outrider.planner.guided_pilot import GuidedPilot
from outrider.planner.own_parts import OwnGoals, OwnMethods, OwnSurface
from outrider.planner.surroundings import Surroundings
from outrider.planner.values import Neighbour, Obstacle, Plan, Setpoint, Step, Target, microseconds

Value = TypeVar("Value")
Neighbours = Sequence[Neighbour] | Array
"""Neighbours, or an array (M, 6) of their positions (m) and velocities (m/s).

Rows have the ids 1, 2, … in turn, without the planner's own.
"""
Obstacles = Sequence[Obstacle] | Array
"""Obstacles, or an array (M, 4) of centres and radii of balls at rest, m."""


class Planner:
    """Planner of the vehicle ``id`` (1 to 255), with the companion's own avoidance, goals and yaw.

    ``config``: the companion's settings; those of links, estimators, ``neighbour_prediction`` and of the
    flight's phases have no effect here. ``surface``: a surface around the target in place of the configured
    one; ``methods``: methods of the field in addition to the configured ones. ``origin``: latitude and
    longitude (deg) and altitude (m) of the zero of all positions, which planners with committed plans must
    have in common. Raises InputError.

    Everything is east-north-up, in metres and seconds, on one clock of the caller. With committed plans
    (``avoidance: certified``) all planners must have the same clock, within ``certified.clock_us``.
    """

    def __init__(
        self,
        config: CompanionConfig | None = None,
        *,
        id: int = 1,
        surface: OwnSurface | None = None,
        methods: Sequence[Method] = (),
        origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        config = CompanionConfig() if config is None else config
        if not isinstance(config, CompanionConfig):
            raise InputError(f"config: is a {type(config).__name__}; allowed: a PlannerConfig")
        if config.avoidance == "certified" and methods:
            raise InputError("methods: committed plans use none; allowed: avoidance 'field', or no methods")
        if config.moving:
            raise InputError("moving: these obstacles send messages; allowed: none; give `obstacles` to step")
        # Both wait for messages that a planner without links does not get.
        self.config = config = config.model_copy(
            update={
                "traffic": None,
                "certified": config.certified.model_copy(update={"fleet_time": "own"}),
            }
        )
        if surface is not None and not callable(getattr(surface, "nearest", None)):
            raise InputError(
                f"surface: is a {type(surface).__name__}; allowed: an object with nearest(offset)"
            )
        own_methods = _sequence("methods", methods, "methods of the field")
        for one in own_methods:
            if not callable(getattr(one, "influence", None)):
                raise InputError(
                    f"methods: one is a {type(one).__name__}; "
                    "allowed: objects with influence(scene, influence)"
                )
        self.id = system_id("id", id)
        self._surface, self._methods = surface, own_methods
        self._fleet = FleetFrame(*checked("origin", origin, (3,), "deg, deg, m").tolist())
        self._local = self._fleet.local(self._fleet.latitude, self._fleet.longitude, self._fleet.altitude)
        self.reset()

    def reset(self) -> None:
        """Forget all plans and times: the next step begins a new flight."""
        config, own = self.config, Source(self.id, COMPONENT)
        self._now: int | None = None
        self._codec = Codec()
        self._pilot = GuidedPilot(config, own)
        self._surroundings = Surroundings(config, self._local)
        self._times = PlanTimes(time.perf_counter_ns, lambda _spent: None)
        # Planning calls only what Surroundings has; whatever else it asked for would raise AttributeError.
        world = cast(World, self._surroundings)
        self._avoidance: Avoidance
        if config.avoidance == "field":
            field = FieldAvoidance(config, world, self._pilot, self._times)
            if self._methods:
                field.planner = OwnMethods(config, self._methods)
            self._avoidance = field
        else:
            parts = VehicleParts(config, own, self._fleet, world, self._pilot, self._times)
            self._avoidance = CertifiedAvoidance(parts)
        ahead = self._avoidance.lookahead_s
        self._goals = OwnGoals(config, self.id, self._pilot, ahead, self._surface)
        self._planning = Planning(config, world, self._pilot, self._goals, self._avoidance)

    def step(
        self,
        now: float,
        position: ArrayLike,
        velocity: ArrayLike,
        *,
        yaw: float | None = None,
        target: Target | None = None,
        goal: ArrayLike | None = None,
        neighbours: Neighbours = (),
        obstacles: Obstacles = (),
        packets: Iterable[bytes] = (),
    ) -> Step:
        """Plan if a plan is due, and return what is flown at ``now`` (s).

        ``position`` (3,) m and ``velocity`` (3,) m/s: the own state; ``yaw``: the own yaw, rad,
        counter-clockwise from east, used by the first step only (None: towards the target). The vehicle flies
        to ``goal`` (3,), m, if one is given, otherwise to its surface around ``target``, and without either
        it holds its position. ``packets``: what the other planners' steps gave since the last step, with
        committed plans.

        A plan is made every ``rates.replan_us``, or in each step if those are further apart. Raises
        InputError for wrong shapes, values that are not finite, and times that go back.
        """
        time_us = microseconds("now", now)
        if self._now is not None and time_us < self._now:
            raise InputError(
                f"now: is {now:g} s, before the last step; allowed: {1e-6 * self._now:g} s or later"
            )
        own = checked("position", position, (3,), "m"), checked("velocity", velocity, (3,), "m/s")
        if target is not None and not isinstance(target, Target):
            raise InputError(f"target: is a {type(target).__name__}; allowed: a Target")
        self._goals.goal = None if goal is None else checked("goal", goal, (3,), "m")
        heading = self._yaw(yaw, own[0], target)
        others, around = _neighbours(neighbours, self.id), _obstacles(obstacles)
        if self._now is None:
            self._avoidance.next_due = time_us
        self._now = time_us
        self._receive(time_us, packets)
        view = self._surroundings.take(time_us, (*own, heading), target, others, around)
        return self._planned(time_us, view)

    def _planned(self, now: int, view: View) -> Step:
        """Return what is flown at ``now`` (µs) after a step of planning."""
        avoidance, planning = self._avoidance, self._planning
        self._goals.forget(view)
        planning.step(now, view, cautious=False)
        messages = avoidance.messages(now, farewell=False)
        packets = tuple(self._codec.encode(message) for message in messages)
        avoidance.shed()
        spent = self._times.shed()
        plan_ms = 1e-6 * spent[-1] if spent else None
        horizon = avoidance.horizon
        if horizon is None:
            return Step(None, None, avoidance.state.value, packets, plan_ms)
        later = now + self.config.setpoint_lead_us
        motion, facing = horizon.at(later), planning.yaw(later)
        setpoint = Setpoint(1e-6 * later, *motion, facing.yaw, facing.rate)
        return Step(Plan(horizon), setpoint, avoidance.state.value, packets, plan_ms)

    def _yaw(self, yaw: float | None, position: Array, target: Target | None) -> float:
        """Return the own yaw (rad) to begin with."""
        if yaw is not None:
            return number("yaw", yaw, "rad")
        return 0.0 if target is None else bearing(position, np.asarray(target.position))

    def _receive(self, now: int, packets: Iterable[bytes]) -> None:
        """Receive packets of other planners; what is no packet is ignored, as on a link."""
        for packet in _sequence("packets", packets, "bytes"):
            if not isinstance(packet, bytes | bytearray):
                raise InputError(f"packets: one is a {type(packet).__name__}; allowed: bytes")
            for message in self._codec.feed(bytes(packet), whole=True):
                if message.source.system != self.id:
                    self._avoidance.receive(now, "swarm", message)


def _neighbours(given: Neighbours, own: int) -> tuple[Neighbour, ...]:
    """Return ``given`` as neighbours, each id once and none the ``own``. Raises InputError."""
    if isinstance(given, np.ndarray):
        rows = checked("neighbours", given, ("M", 6), "m and m/s")
        ids = (k for k in count(1) if k != own)
        found = tuple(Neighbour(k, row[:3], row[3:]) for k, row in zip(ids, rows, strict=False))
    else:
        found = _sequence("neighbours", given, "Neighbour, or an array (M, 6)")
    known: set[int] = set()
    for one in found:
        if not isinstance(one, Neighbour):
            raise InputError(
                f"neighbours: one is a {type(one).__name__}; allowed: Neighbour, or an array (M, 6)"
            )
        if one.id in known or one.id == own:
            whose = "the planner's own id" if one.id == own else "there twice"
            raise InputError(f"neighbours: id {one.id} is {whose}; allowed: each id once, not the own")
        known.add(one.id)
    return found


def _obstacles(given: Obstacles) -> tuple[Obstacle, ...]:
    """Return ``given`` as obstacles. Raises InputError."""
    if isinstance(given, np.ndarray):
        rows = checked("obstacles", given, ("M", 4), "m: centre and radius")
        return tuple(Obstacle(row[:3], float(row[3])) for row in rows)
    found = _sequence("obstacles", given, "Obstacle, or an array (M, 4)")
    for one in found:
        if not isinstance(one, Obstacle):
            raise InputError(
                f"obstacles: one is a {type(one).__name__}; allowed: Obstacle, or an array (M, 4)"
            )
    return found


def _sequence(name: str, given: Iterable[Value], of: str) -> tuple[Value, ...]:
    """Return ``given`` as a tuple; raise InputError if it is nothing that can be counted through."""
    if isinstance(given, str | bytes) or not isinstance(given, Iterable):
        raise InputError(f"{name}: is a {type(given).__name__}; allowed: a sequence of {of}")
    return tuple(given)
