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

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import GlobalPosition, Source
from mavlink_bridge.wire.codec import Codec
from outrider.bench import certified as bench_certified
from outrider.bench import field as bench_field
from outrider.bench import fusion as bench_fusion
from outrider.bench import receive as bench_receive
from outrider.bench import stages, start
from outrider.bench import tlog as bench_tlog
from outrider.resources import config_root, find
from outrider.scenarios.options import Options
from outrider.simulation.flight import Flight
from outrider.simulation.preparation import prepare
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.airframe import airframe, airframe_record
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, advance_many, command_row, initial_states

Progress = Callable[[str, float], None]
_FLEETS = (1, 8, 64, 512)
_STEPS_A_CALL = 8


def measure(progress: Progress, *, quick: bool) -> dict[str, object]:
    """Return all figures; with ``quick`` from fewer rounds and without flights."""
    rounds = 3 if quick else 9
    progress("plan step", 0.0)
    steps, solves, piqp = bench_field.plan_step(rounds)
    certified = bench_certified.plan_step(rounds)
    by_stage = stages.measured()
    progress("physics", 0.2)
    figures: dict[str, object] = {
        "plan_step_ms": {"field": _levels(steps), "certified": _levels(certified)},
        "least_plan_step_ms": {
            "field": _levels(_least(steps, rounds)),
            "certified": _levels(_least(certified, rounds)),
        },
        "piqp_ms": _levels(piqp),
        "solve_ms": _levels(solves),
        "fly_start": start.fastest(),
        "piqp_share": round(float(np.median(piqp) / np.median(steps)), 3),
        "stages_us": by_stage,
        "vehicle_steps_per_cpu_s": physics(rounds),
    }
    progress("codec and tlog", 0.4)
    figures["codec_us"] = codec(rounds)
    figures["receive_us"] = bench_receive.receiving(rounds)
    figures["fusion_us"] = bench_fusion.figures(rounds, float(np.median(steps)))
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


def _per_call(call: Callable[[], object], calls: int = 5_000) -> float:
    started = time.process_time()
    for _ in range(calls):
        call()
    return (time.process_time() - started) / calls * 1e6


def _least(values: np.ndarray, rounds: int) -> np.ndarray:
    """Return the least time of each scene, from the times of all scenes in each of ``rounds``.

    Its levels show how plans differ; those of all times also show what else the machine does.
    """
    return np.asarray(values.reshape(rounds, -1).min(axis=0))


def _levels(values: np.ndarray) -> dict[str, float]:
    return {f"p{q}": round(float(np.percentile(values, q)), 4) for q in (50, 99)}
