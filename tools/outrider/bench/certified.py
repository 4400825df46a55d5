"""Certified plan step of ``outrider bench``: from received peer plans to plan and set-point."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.committed import committed
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.field.planner import Aim, standing
from companion.config import CompanionConfig
from companion.flight.setpoint import setpoint
from companion.goals.heading import Heading
from companion.values.bearings import bearing
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from companion.world import World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.agreements import pack as pack_statement
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, WirePlan, pack, quantise
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load

_NEIGHBOURS = 8
_SCENES = 60


class Scene(NamedTuple):
    """Moving vehicle among eight neighbours within planning range, ready to plan."""

    flight: CertifiedFlight
    world: World
    plan: WirePlan
    aim: Aim


def plan_step(rounds: int) -> Array:
    """Return the CPU time (ms) of each plan step.

    Raises RuntimeError if a plan is not solved, because its time would not be that of a full plan step.
    """
    scenario = load(find("scenarios", "antipodal-8"), Scenario)
    config = scenario.companion.model_copy(update={"avoidance": "certified", "turning_sense": "right"})
    epoch = 10 * config.certified.epoch_us
    scenes = [_scene(config, seed, epoch) for seed in range(_SCENES)]
    fleet = scenes[0].world.fleet
    local = fleet.local(fleet.latitude, fleet.longitude, fleet.altitude)
    steps, count = config.horizon.dt_us, config.horizon.steps + 1
    spent, unsolved = [], 0
    for turn in range(rounds + 1):
        for flight, world, plan, aim in scenes:
            flight.commitment.current, flight.commitment.following = plan, None
            heading = Heading(config.heading, config.horizon)
            heading.reset(bearing(plan.position_m, aim.target))
            started = time.thread_time_ns()
            unsolved += not flight.plan(epoch, aim, world, world.at(epoch))
            horizon = flight.horizon()
            if horizon is None:
                raise RuntimeError("the benchmark's scene has no plan")
            targets = np.broadcast_to(aim.target, (count, 3))
            heading.plan(epoch, horizon.positions(epoch + steps, count, steps), targets)
            setpoint(epoch + 10_000, 0, horizon, heading.at(epoch + 10_000), local, Source(1, COMPONENT), 0)
            finished = time.thread_time_ns()
            if turn:
                spent.append(finished - started)
    if unsolved:
        raise RuntimeError(f"{unsolved} of the benchmark's certified plans were not solved")
    return np.array(spent) * 1e-6


def _scene(config: CompanionConfig, seed: int, epoch: int) -> Scene:
    """Return a scene: eight neighbours around, 1.5 to 3 m away at the same height, with similar velocity."""
    random = np.random.default_rng(seed)
    fleet = FleetFrame(47.397742, 8.545594, 488.0)
    flight = CertifiedFlight(config, Source(1, COMPONENT), fleet)
    world = World(config, 1, 101, fleet)
    here = np.array([0.0, 0.0, 5.0])
    around = 2.0 * np.pi * (np.arange(_NEIGHBOURS) + random.uniform(-0.2, 0.2, _NEIGHBOURS)) / _NEIGHBOURS
    reach = random.uniform(1.5, 3.0, _NEIGHBOURS)
    angle = random.uniform(0.0, 2.0 * np.pi)
    course = np.array([np.cos(angle), np.sin(angle), 0.0])
    for k in range(_NEIGHBOURS):
        place = here + reach[k] * np.array([np.cos(around[k]), np.sin(around[k]), 0.0])
        speed = course + random.uniform(-0.15, 0.15, 3) * (1.0, 1.0, 0.1)
        plan = _braking(config, epoch, place, speed, fleet.fingerprint)
        flight.receive(epoch, Tunnel(Source(20 + k, COMPONENT), 0, 0, PAYLOAD_TYPE, pack(plan)))
    own = _braking(config, epoch, here, course, fleet.fingerprint)
    _agree(flight, own)
    return Scene(flight, world, own, standing(here + 8.0 * course, np.array([2.0, 2.0, 0.0])))


def _agree(flight: CertifiedFlight, own: WirePlan) -> None:
    """Make the neighbours' agreements on the newest plans, so that the plan keeps planes from all of them.

    Raises RuntimeError if one is refused.
    """
    agreements, epoch = flight.agreements, own.epoch
    agreements.begin(epoch)
    agreements.made(own)
    stated = pack_statement(
        Statement(agreements.fingerprint, epoch, epoch, (Entry(1, ((epoch, epoch),), (epoch, epoch)),))
    )
    for k in range(_NEIGHBOURS):
        flight.receive(epoch, Tunnel(Source(20 + k, COMPONENT), 0, 0, AGREEMENTS, stated))
    agreements.update(epoch)
    if agreements.missing() or len(agreements.agreed()) != _NEIGHBOURS:
        raise RuntimeError("the benchmark's scene lacks an agreement")


def _braking(config: CompanionConfig, epoch: int, place: Array, speed: Array, origin: int) -> WirePlan:
    """Return a plan that brakes evenly from the given state to rest over the horizon."""
    n, dt = config.horizon.steps + 1, config.certified.dt_us
    start = quantise(epoch, dt, place, speed, np.zeros((n, 3)), origin)
    return committed(start, np.broadcast_to(-speed / (n * dt * 1e-6), (n, 3)))
