"""Run directories for the report, made without a flight: everything in them is known."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from math import tau
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    CommandAck,
    GlobalPosition,
    Heartbeat,
    LocalPosition,
    Message,
    Source,
    StatusText,
)
from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.codec import Codec
from outrider.runs import names
from outrider.scenarios.scenario import Scenario
from tests.outrider.shipped import scenario as shipped

BOOT = 1_767_225_600_000_000
BEFORE = 3.0
"""s from boot to the goal event."""
ARRIVAL = 20_000
"""µs on the way."""

NEARER = 0.07
"""m by which two vehicles were nearer between two samples than at them."""
Lost = Callable[[int, int, int], bool]
"""Of the nth message from one system to another: whether it is lost."""


class WrittenRun(NamedTuple):
    """Where the run lies; its times (T,) and positions (T, K, 3)."""

    directory: Path
    time: np.ndarray
    position: np.ndarray


def leave(
    directory: Path,
    vehicles: int = 3,
    seconds: float = 10.0,
    scenario: Scenario | None = None,
    logs: bool = True,
    lost: Lost = lambda _sender, _receiver, _n: False,
    text: str = "Armed",
    late: dict[int, int] | None = None,
    **summary: object,
) -> WrittenRun:
    """Vehicles on a circle, each at its own speed, for ``seconds`` after the goal event. ``late``: by how
    many µs a companion's clock is ahead; ``summary``: keys beside the usual ones."""
    directory.mkdir(parents=True, exist_ok=True)
    flown = scenario or shipped("antipodal-8", vehicles=vehicles)
    time = np.arange(-BEFORE, seconds + 1e-9, 0.02)
    position, velocity = circle(time, vehicles)
    _write_configuration(directory, flown)
    _write_summary(directory, vehicles, summary)
    separation = np.where(time < -1.0, np.inf, _least(position) - NEARER)
    np.savez_compressed(
        directory / "flight.npz",
        system=np.arange(11, 11 + vehicles),
        start_us=np.int64(BOOT + round(1e6 * BEFORE)),
        time_s=time,
        position=position.astype(np.float32),
        velocity=velocity.astype(np.float32),
        reference=(position + 0.01).astype(np.float32),
        yaw=np.zeros((len(time), vehicles), np.float32),
        tilt=np.full((len(time), vehicles), 0.1, np.float32),
        target=np.zeros((len(time), 3), np.float32),
        separation=separation.astype(np.float32),
        moving=np.empty((len(time), 0, 3), np.float32),
    )
    plans = np.arange(0.0, seconds, 0.01)
    system = np.repeat(np.arange(11, 11 + vehicles), len(plans))
    gradient = np.full((len(system), 3), 0.5, np.float32)
    np.savez_compressed(
        directory / "plans.npz", system=system, time_s=np.tile(plans, vehicles), gradient=gradient
    )
    spent = np.linspace(0.2, 0.4, len(system))
    due = np.tile(plans, vehicles)
    np.savez_compressed(directory / "plan_times.npz", system=system, time_s=due, plan_ms=spent)
    if logs:
        _write_logs(directory, vehicles, seconds, lost, text, late or {})
    return WrittenRun(directory, time, position)


def circle(time: np.ndarray, vehicles: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (T, K, 3): at rest until the goal event, then round, faster and faster."""
    since = np.maximum(time, 0.0)[:, None]
    first = tau * np.arange(vehicles) / vehicles
    angle = first + 0.02 * since**2
    place = np.stack([8.0 * np.cos(angle), 8.0 * np.sin(angle), np.full(angle.shape, 5.0)], axis=-1)
    rate = 0.04 * since[..., None]
    speed = 8.0 * rate * np.stack([-np.sin(angle), np.cos(angle), np.zeros(angle.shape)], axis=-1)
    return place, speed


def _least(position: np.ndarray) -> np.ndarray:
    count = position.shape[1]
    pairs = [(j, k) for j in range(count) for k in range(j + 1, count)]
    if not pairs:
        return np.full(len(position), np.inf)
    return np.min([np.linalg.norm(position[:, j] - position[:, k], axis=-1) for j, k in pairs], axis=0)


def _write_configuration(directory: Path, scenario: Scenario) -> None:
    resolved = {"seed": 3, "scenario": scenario.model_dump(mode="json")}
    (directory / "configuration.yaml").write_text(yaml.safe_dump(resolved, sort_keys=False))


def _write_summary(directory: Path, vehicles: int, changes: dict[str, object]) -> None:
    usual = {
        "scenario": "antipodal-8",
        "method": "tangential",
        "avoidance": "field",
        "vehicles": vehicles,
        "converged": True,
        "convergence_time_s": 7.5,
        "min_separation_m": 1.25,
        "d_min_m": 0.5,
        "span_m": 0.63,
        "d_min_violations": 0,
        "plan_ms": {"p50": 0.3, "p99": 0.4, "max": 0.4},
        "failure": None,
    }
    (directory / "summary.json").write_text(json.dumps({**usual, **changes}))


def _write_logs(
    directory: Path, vehicles: int, seconds: float, lost: Lost, text: str, late: dict[int, int]
) -> None:
    """On the swarm link each tells its place ten times a second, and a heartbeat each second."""
    systems = range(11, 11 + vehicles)
    with ExitStack() as files:
        logs = {system: files.enter_context(TlogWriter(directory / names.log(system))) for system in systems}
        records: list[tuple[int, int, int, bytes]] = []
        for k, system in enumerate(systems):
            swarm, companion, autopilot = Codec(), Source(system, 195), Source(system, 1)
            link = Codec()
            for n, tenth in enumerate(range(round(10 * (BEFORE + seconds)))):
                now = BOOT + 100_000 * tenth
                at = tenth / 10 - BEFORE
                (velocity,) = circle(np.array([at]), vehicles)[1][:, k]
                said: list[Message] = [_place(companion, now)]
                if tenth % 10 == 0:
                    said.append(Heartbeat(companion, 18, 8, 0, 0, 4))
                    mode = 4 if tenth else 0
                    own = [
                        Heartbeat(
                            autopilot, 13, 3, mavlink.MAV_MODE_FLAG_SAFETY_ARMED if tenth else 0, mode, 4
                        )
                    ]
                    records += [(now, system, 0, link.encode(beat)) for beat in own]
                east, north, up = velocity.tolist()
                sent = LocalPosition(autopilot, now - BOOT, (0.0, 0.0, 0.0), (north, east, -up))
                records.append((now, system, 0, link.encode(sent)))
                for m, message in enumerate(said):
                    data = swarm.encode(message)
                    records.append((now, system, 1, data))
                    for receiver in systems:
                        if receiver != system and not lost(system, receiver, 2 * n + m):
                            records.append((now + ARRIVAL, receiver, 1, data))
                if tenth == 20:
                    records.append((now, system, 0, link.encode(StatusText(autopilot, 6, text))))
                    refused = CommandAck(
                        autopilot, mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_RESULT_DENIED, 0, 0, system, 195
                    )
                    records.append((now, system, 0, link.encode(refused)))
        for time, owner, number, data in sorted(records):
            logs[owner].write(time + late.get(owner, 0), number, data)


def _place(source: Source, now: int) -> GlobalPosition:
    return GlobalPosition(source, now - BOOT, 47.0, 8.0, 493.0, 5.0, (0.0, 0.0, 0.0), None)
