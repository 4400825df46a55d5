"""Command ``outrider bench``: speed of each part on this machine.

Figures are CPU times, or rates by CPU time, as medians or percentiles over rounds. Compared parts are
measured in turn, so that a temporary slow-down of the machine affects all of them.
"""

from __future__ import annotations

import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.field.planner import Aim, Planner, standing
from companion.config import CompanionConfig
from companion.flight.setpoint import setpoint
from companion.goals.heading import Heading
from companion.telemetry.sharing import position_message
from companion.values.bearings import bearing
from companion.values.components import COMPONENT
from companion.values.obstacles import Obstacles
from companion.world import World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import GlobalPosition, Source, Tunnel
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, pack, quantise
from outrider.bench import certified as bench_certified
from outrider.bench import tlog as bench_tlog
from outrider.resources import config_root, find
from outrider.scenarios.options import Options
from outrider.scenarios.scenario import Scenario
from outrider.simulation.flight import Flight
from outrider.simulation.preparation import prepare
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.airframe import airframe, airframe_record
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, advance_many, command_row, initial_states

Progress = Callable[[str, float], None]
_FLEETS = (1, 8, 64, 512)
_NEIGHBOURS = 8
_STEPS_A_CALL = 8


class Scene(NamedTuple):
    """One instant of a companion with eight neighbours near or within d_safe, ready to plan."""

    world: World
    position: np.ndarray
    velocity: np.ndarray
    aim: Aim


def measure(progress: Progress, *, quick: bool) -> dict[str, object]:
    """Return all figures; with ``quick`` from fewer rounds and without flights."""
    rounds = 3 if quick else 9
    progress("plan step", 0.0)
    steps, piqp = plan_step(rounds)
    progress("physics", 0.2)
    figures: dict[str, object] = {
        "plan_step_ms": {"field": _levels(steps), "certified": _levels(bench_certified.plan_step(rounds))},
        "piqp_ms": _levels(piqp),
        "piqp_share": round(float(np.median(piqp) / np.median(steps)), 3),
        "vehicle_steps_per_cpu_s": physics(rounds),
    }
    progress("codec and tlog", 0.4)
    figures["codec_us"] = codec(rounds)
    figures.update(bench_tlog.reading(rounds))
    if not quick:
        progress("antipodal-8 at 100 Hz", 0.5)
        factor = {"antipodal-8": real_time_factor(None)}
        progress("antipodal-8 at 20 Hz", 0.8)
        factor["antipodal-8 at 20 Hz"] = real_time_factor(20.0)
        figures["real_time_factor"] = factor
    figures["machine"] = f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}"
    progress("done", 1.0)
    return figures


def plan_step(rounds: int) -> tuple[np.ndarray, np.ndarray]:
    """Return CPU times (ms) of plan steps and of their three QPs alone, over crowded scenes.

    A plan step goes from the world to plan and set-point; its QPs are then solved once more.
    """
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
    steps, solving = [], []
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
            _all_act(obstacles)
    return np.array(steps) * 1e-6, np.array(solving) * 1e-6


def physics(rounds: int) -> dict[str, float]:
    """Return vehicle-steps per CPU-second by the number of vehicles per call.

    The controller runs at every step.
    """
    config = load(find("vehicles", "firefly"), VehicleConfig)
    record = airframe_record(airframe(config))
    rates: dict[int, list[float]] = {count: [] for count in _FLEETS}
    fleets = {}
    for count in _FLEETS:
        places = np.zeros((count, 3))
        places[:, 0] = np.arange(count)
        places[:, 2] = -5.0
        states = initial_states(config, places, np.zeros(count), 0.0)
        commands = np.array(
            [command_row(Reference.hover(place + np.array([1.0, 0.0, 0.0]))) for place in places]
        )
        fleets[count] = states, commands
        advance_many(states, commands, record, _STEPS_A_CALL)
    for _ in range(rounds):
        for count, (states, commands) in fleets.items():
            calls = max(1, 120_000 // (count * _STEPS_A_CALL))
            started = time.process_time()
            for _ in range(calls):
                advance_many(states, commands, record, _STEPS_A_CALL)
            rates[count].append(calls * count * _STEPS_A_CALL / (time.process_time() - started))
    return {str(count): round(float(np.median(values))) for count, values in rates.items()}


def codec(rounds: int) -> dict[str, float]:
    """Return the CPU time (µs) to pack and to parse a GLOBAL_POSITION_INT."""
    message = GlobalPosition(
        Source(11, mavlink.MAV_COMP_ID_AUTOPILOT1), 1_000_000, 47.0, 8.0, 500.0, 5.0, (1.0, 2.0, 0.5), 1.0
    )
    sender, receiver = Codec(), Codec()
    pack_us, parse_us = [], []
    frame = sender.encode(message)
    for _ in range(rounds):
        pack_us.append(_per_call(lambda: sender.encode(message)))
        parse_us.append(_per_call(lambda: receiver.feed(frame)))
    return {"pack": round(float(np.median(pack_us)), 2), "parse": round(float(np.median(parse_us)), 2)}


def real_time_factor(replan_hz: float | None) -> float:
    """Return simulated seconds per CPU-second of antipodal-8 in lock-step on one core, seed 1, with logs."""
    prepared = prepare("antipodal-8", Options(replan_hz=replan_hz))
    with tempfile.TemporaryDirectory() as folder:
        flight = Flight(*prepared, 1, config_root() / "logs", run_directory=Path(folder))
        started = time.process_time()
        flight.run()
        spent = time.process_time() - started
    times = flight.truth.samples().time
    return round(float(times[-1] - times[0]) * 1e-6 / spent, 2)


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


def _per_call(call: Callable[[], object], calls: int = 5_000) -> float:
    started = time.process_time()
    for _ in range(calls):
        call()
    return (time.process_time() - started) / calls * 1e6


def _levels(values: np.ndarray) -> dict[str, float]:
    return {f"p{q}": round(float(np.percentile(values, q)), 4) for q in (50, 99)}
