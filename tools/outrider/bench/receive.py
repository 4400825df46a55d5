"""Time that one companion takes to receive a neighbour's position and plan, as in ``outrider fly``.

Every message is new, so no cache that companions of one process share saves anything.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

import numpy as np

from companion.config import CompanionConfig
from companion.obstacles import shared_plans
from companion.obstacles.neighbour_tracks import measurement_of
from companion.telemetry.sharing import position_message
from companion.values.components import COMPONENT
from companion.world import World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, Source, Tunnel
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, pack, quantise
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load

_MESSAGES = 1_000
_PERIOD_US = 100_000
_DELAY_US = 20_000


class Received(NamedTuple):
    """A datagram with one message, and when it arrives (µs)."""

    now: int
    data: bytes


def receiving(rounds: int) -> dict[str, dict[str, float]]:
    """Return CPU times (µs) of a neighbour's GLOBAL_POSITION_INT and of its TUNNEL with a plan, medians.

    ``converted``: from the decoded message to position and velocity in the fleet frame, or to a horizon.
    ``whole``: from the bytes of the datagram until the world picture contains it.
    Raises RuntimeError if a message was not used.
    """
    config = load(find("scenarios", "antipodal-8"), Scenario).companion
    fleet = FleetFrame(47.397742, 8.545594, 488.0)
    convert: dict[str, Callable[[Message], object]] = {
        "position": lambda message: measurement_of.__wrapped__(fleet, message, False),
        "plan": lambda message: shared_plans.read.__wrapped__(message.payload),  # type: ignore[attr-defined]
    }
    spent: dict[str, dict[str, list[float]]] = {kind: {"converted": [], "whole": []} for kind in convert}
    for turn in range(rounds):
        world, codec = World(config, 1, 101, fleet), Codec()
        for kind, datagrams in _neighbour(config, fleet, seed=turn).items():
            messages: list[Message] = []
            spent[kind]["whole"].append(_per_item(partial(_receive, codec, world, messages), datagrams))
            spent[kind]["converted"].append(_per_item(convert[kind], messages))
            if len(messages) != _MESSAGES:
                raise RuntimeError(f"the benchmark's {kind} messages were not received")
        if world.neighbours.refused_plans or len(world.neighbours.last_received()) != 1:
            raise RuntimeError("the benchmark's messages were not used")
    return {
        kind: {name: round(float(np.median(values)), 2) for name, values in times.items()}
        for kind, times in spent.items()
    }


def _receive(codec: Codec, world: World, found: list[Message], one: Received) -> None:
    for message in codec.feed(one.data, whole=True):
        world.receive(one.now, "swarm", message)
        found.append(message)


def _neighbour(config: CompanionConfig, fleet: FleetFrame, seed: int) -> dict[str, list[Received]]:
    """Return the positions and the plans of a neighbour that flies a circle of 1 m at 1 m/s."""
    random, codec, source = np.random.default_rng(seed), Codec(), Source(20, COMPONENT)
    positions, plans = [], []
    for k in range(1, _MESSAGES + 1):
        sent = k * _PERIOD_US
        angle = 1e-6 * sent + random.uniform(0.0, 1e-3)
        place = np.array([np.cos(angle), np.sin(angle), 5.0])
        speed = np.array([-np.sin(angle), np.cos(angle), 0.0])
        position = position_message(source, sent, fleet, place, speed, None)
        accelerations = random.normal(0.0, 1.0, (config.horizon.steps + 1, 3))
        plan = quantise(sent, config.horizon.dt_us, place, speed, accelerations, fleet.fingerprint)
        positions.append(Received(sent + _DELAY_US, codec.encode(position)))
        plans.append(Received(sent + _DELAY_US, codec.encode(Tunnel(source, 0, 0, PAYLOAD_TYPE, pack(plan)))))
    return {"position": positions, "plan": plans}


def _per_item(call: Callable[..., object], items: Iterable[object]) -> float:
    """Return the CPU time (µs) of ``call`` for each of ``items``."""
    every = list(items)
    started = time.thread_time_ns()
    for item in every:
        call(item)
    return (time.thread_time_ns() - started) * 1e-3 / len(every)
