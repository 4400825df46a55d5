"""Speed of a plan step with avoidance by the field."""

from __future__ import annotations

import time
from functools import cache
from typing import NamedTuple

import numpy as np

from companion.avoidance.field.dqmpc import Dqmpc, Problem
from companion.avoidance.field.planner import Aim, Planner, standing
from companion.avoidance.field.qp_vectors import keeps_limits
from companion.avoidance.solver import QpSolver
from companion.config import CompanionConfig
from companion.flight.setpoint import setpoint
from companion.goals.heading import Heading
from companion.telemetry.sharing import position_message
from companion.values.bearings import bearing
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles
from companion.world import World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, pack, quantise
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load

_NEIGHBOURS = 8


class Scene(NamedTuple):
    """One instant of a companion with eight neighbours near or within d_safe, ready to plan."""

    world: World
    position: np.ndarray
    velocity: np.ndarray
    aim: Aim


class Times(NamedTuple):
    """CPU times (ms) of plan steps, of their three QPs alone, and of these QPs as PIQP solves them whole.

    A plan step goes from the world to plan and set-point; its QPs are then solved once more (``solves``), as
    the plan step solves them: for what binds. ``piqp`` solves them whole: all variables with their bounds,
    and those that break a state limit once more with these limits. Its time does not depend on the planner:
    it is a yardstick for the rest of a plan step.
    """

    steps: Array
    solves: Array
    piqp: Array


def plan_step(rounds: int) -> Times:
    """Return the times of plan steps over crowded scenes."""
    config = load(find("scenarios", "antipodal-8"), Scenario).companion
    scenes = [_scene(config, seed) for seed in range(60)]
    # Each scene has its own planner, because a planner keeps state between plans.
    planners = [Planner(config) for _ in scenes]
    headings = [Heading(config.heading, config.horizon) for _ in scenes]
    for scene, heading in zip(scenes, headings, strict=True):
        # As in flight, the vehicle faces the target when planning begins.
        heading.reset(bearing(scene.position, scene.aim.target))
    fleet = scenes[0].world.fleet
    local = fleet.local(fleet.latitude, fleet.longitude, fleet.altitude)
    steps, solving, problems = [], [], []
    horizon = config.horizon
    ahead = 1e-6 * horizon.dt_us * np.arange(1, horizon.steps + 2)
    now = 1_000_000
    for turn in range(rounds + 1):
        for (world, position, velocity, aim), planner, heading in zip(
            scenes, planners, headings, strict=True
        ):
            prediction = position + np.vstack([np.zeros(1), ahead[:-1, None]]) * velocity
            started = time.thread_time_ns()
            obstacles = world.obstacles(now, world.at(now), prediction)
            plan = planner.plan(now, position, velocity, prediction, aim, obstacles)
            targets = np.broadcast_to(aim.target, (horizon.steps + 1, 3))
            heading.plan(now, plan.horizon.knots[1:, 0:3], targets)
            setpoint(now + 10_000, 0, plan.horizon, heading.at(now + 10_000), local, Source(1, COMPONENT), 0)
            finished = time.thread_time_ns()
            planner.dqmpc.solve(plan.problem, plan.omega_scale)
            solved = time.thread_time_ns()
            if turn:
                steps.append(finished - started)
                solving.append(solved - finished)
            else:
                problems.append((plan.problem, plan.omega_scale))
            _all_act(obstacles)
    piqp_of = cache(lambda omega_scale: _WholeQps(planners[0].dqmpc, omega_scale))
    whole = [piqp_of(omega_scale).solve(problem) for problem, omega_scale in rounds * problems]
    return Times(*(1e-6 * np.array(spent) for spent in (steps, solving, whole)))


class _WholeQps:
    """PIQP's solvers of the whole QPs of ``dqmpc`` for one weight, without and with state limits."""

    def __init__(self, dqmpc: Dqmpc, omega_scale: float) -> None:
        self._dqmpc = dqmpc
        P = dqmpc.hessian(omega_scale)
        self._bounded, self._limited = QpSolver(P), QpSolver(P, dqmpc.G)

    def solve(self, problem: Problem) -> int:
        """Return the CPU time (ns) of the three QPs, and once more of those that break a state limit."""
        started = time.thread_time_ns()
        found = [self._bounded.solve(*vectors) for vectors in zip(*problem[:3], strict=True)]
        kept = keeps_limits(np.array(found), self._dqmpc.dt, problem.h_l, problem.h_u)
        broken = [axis for axis in range(3) if not kept >> axis & 1]
        if broken:
            c, *bounds = self._dqmpc.reachable(problem)[:5]
            for axis in broken:
                x_l, x_u, h_l, h_u = (bound[axis] for bound in bounds)
                self._limited.solve(c[axis], x_l, x_u, h_l, h_u)
        return time.thread_time_ns() - started


def _scene(config: CompanionConfig, seed: int) -> Scene:
    """Return a scene as in a swap: eight neighbours around, the goal behind them.

    The neighbours are 1.5 to 3 m away at the same height, each with a shared horizon.
    """
    random = np.random.default_rng(seed)
    fleet = FleetFrame(47.397742, 8.545594, 488.0)
    world = World(config, 1, 101, fleet)
    position = np.array([0.0, 0.0, 5.0])
    around = 2.0 * np.pi * (np.arange(_NEIGHBOURS) + random.uniform(-0.2, 0.2, _NEIGHBOURS)) / _NEIGHBOURS
    reach = random.uniform(1.5, 3.0, _NEIGHBOURS)
    for k in range(_NEIGHBOURS):
        place = position + reach[k] * np.array([np.cos(around[k]), np.sin(around[k]), 0.0])
        speed = random.normal(0.0, 1.0, 3) * (1.0, 1.0, 0.1)
        source = Source(20 + k, COMPONENT)
        world.receive(980_000, "swarm", position_message(source, 0, fleet, place, speed, None))
        shared = quantise(
            960_000,
            config.horizon.dt_us,
            place,
            speed,
            random.normal(0.0, 1.0, (config.horizon.steps + 1, 3)) * (1.0, 1.0, 0.1),
            fleet.fingerprint,
        )
        world.receive(980_000, "swarm", Tunnel(source, 0, 0, PAYLOAD_TYPE, pack(shared)))
    angle = random.uniform(0.0, 2.0 * np.pi)
    goal = position + 8.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
    velocity = 1.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
    return Scene(world, position, velocity, standing(goal, np.array([2.0, 2.0, 0.0])))


def _all_act(obstacles: Obstacles) -> None:
    """Raise RuntimeError unless all eight neighbours are present and less than d_safe + 0.5 m away."""
    distance = np.linalg.norm(obstacles.positions[:, 0] - (0.0, 0.0, 5.0), axis=1)
    if len(distance) != _NEIGHBOURS or distance.max() >= obstacles.d_safe.max() + 0.5:
        raise RuntimeError("the benchmark's scene lacks a neighbour within the reach of the field")
