"""Cost of the fusion of detections to one companion: eight cameras of 10 Hz, plans at 20 Hz.

Between two plans four detections arrive, each as CAMERA_FOV_STATUS and CAMERA_TRACKING_GEO_STATUS: those of
the own camera and those that seven neighbours forward. Every message is new.
"""

from __future__ import annotations

import time
from math import atan2, hypot
from typing import Final, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.telemetry.sharing import forwarded, position_message
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from companion.world import World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import (
    CameraFovStatus,
    CameraTrackingGeo,
    GpsGlobalOrigin,
    LocalPosition,
    Message,
    Source,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load

_SYSTEM: Final = 11
_CAMERAS: Final = 8
_PERIOD_US: Final = 100_000
_PLAN_US: Final = 50_000
_DELAY_US: Final = 20_000
_LATENCY_US: Final = 100_000
_WARM_UP, _PLANS = 100, 200
"""Numbers of plans: those in which the filter's memory is used for the first time, and measured ones."""
_START_US: Final = 10_000_000
_AHEAD_S: Final = 1.5
_SITE: Final = (47.397742, 8.545594, 488.0)
_AUTOPILOT: Final = Source(_SYSTEM, mavlink.MAV_COMP_ID_AUTOPILOT1)
_ALONG: Final = 0.08
_ACROSS: Final = 0.002
"""σ of a detection along its ray and across it, as shares of the distance."""


class Costs(NamedTuple):
    """CPU times (µs) between two plans, (n,): of each part, and of all together.

    ``decoded``: from bytes to messages. ``checked``: from messages to detections that wait for the filter.
    ``filtered``: until the target's state is known, as a plan needs it. ``formation``: what the formation
    ``perception`` asks for in addition.
    """

    decoded: Array
    checked: Array
    filtered: Array
    formation: Array


def figures(rounds: int, plan_ms: float) -> dict[str, float]:
    """Return the mean CPU time (µs) of each part between two plans, and of ``all``.

    ``share_of_plan``: of ``all`` in a plan of ``plan_ms`` (ms); ``share_of_period``: in the 50 ms between two
    plans. Means, because the filter forgets old detections in batches.
    """
    costs = cost(rounds)
    means = {name: float(np.mean(spent)) for name, spent in costs._asdict().items()}
    whole = sum(means.values())
    return {
        **{name: round(mean, 1) for name, mean in means.items()},
        "all": round(whole, 1),
        "share_of_plan": round(1e-3 * whole / plan_ms, 3),
        "share_of_period": round(whole / _PLAN_US, 5),
    }


def cost(rounds: int) -> Costs:
    """Return the costs of ``rounds`` times ten seconds, each with other noise.

    Raises RuntimeError if a detection was not used, because its cost would not be that of a full update.
    """
    config = load(find("scenarios", "perception"), Scenario).companion
    return Costs(
        *(
            np.concatenate(parts)
            for parts in zip(*map(_flight, rounds * [config], range(rounds)), strict=True)
        )
    )


def _flight(config: CompanionConfig, seed: int) -> Costs:
    fleet = FleetFrame(*_SITE)
    world, codec = World(config, _SYSTEM, 101, fleet), Codec()
    spent = np.zeros((4, _PLANS))
    random = np.random.default_rng(seed)
    for plan in range(-_WARM_UP, _PLANS):
        now = _START_US + plan * _PLAN_US
        others, detections = _arriving(fleet, random, plan)
        for link, data in others:
            for message in codec.feed(data, whole=True):
                world.receive(now, link, message)
        marks = [time.thread_time_ns()]
        messages = [(link, message) for link, data in detections for message in codec.feed(data, whole=True)]
        marks.append(time.thread_time_ns())
        for link, message in messages:
            world.receive(now, link, message)
        marks.append(time.thread_time_ns())
        world.target.last(now)
        marks.append(time.thread_time_ns())
        world.sight(now, _AHEAD_S)
        marks.append(time.thread_time_ns())
        if plan >= 0:
            spent[:, plan] = np.diff(marks)
    counts = None if world.fusion is None else world.fusion.counts
    if counts is None or counts.used < (_WARM_UP + _PLANS) * _CAMERAS // 2 - _CAMERAS:
        raise RuntimeError(f"the benchmark's detections were not all used: {counts}")
    return Costs(*(1e-3 * spent))


def _arriving(
    fleet: FleetFrame, random: np.random.Generator, plan: int
) -> tuple[list[Datagram], list[Datagram]]:
    """Return what arrives between the plan before and ``plan``: positions, and four detections."""
    others, detections = [], []
    for camera in range(plan % 2, _CAMERAS, 2):
        sent = _START_US + plan * _PLAN_US - _DELAY_US
        system = _SYSTEM + camera
        around = 2.0 * np.pi * camera / _CAMERAS
        place = np.array([6.0 * np.cos(around), 6.0 * np.sin(around), 5.0])
        view, seen = _detection(fleet, random, system, sent - _LATENCY_US, place)
        if system == _SYSTEM:
            others.append(_datagram("autopilot", GpsGlobalOrigin(_AUTOPILOT, *_SITE, sent)))
            ned = (float(place[1]), float(place[0]), -float(place[2]))
            others.append(_datagram("autopilot", LocalPosition(_AUTOPILOT, sent, ned, (0.0, 0.0, 0.0))))
            detections.append(_datagram("autopilot", view, seen))
        else:
            source = Source(system, COMPONENT)
            position = position_message(source, sent, fleet, place, np.zeros(3), None)
            others.append(_datagram("swarm", position))
            detections.append(_datagram("swarm", *forwarded(source, sent - _LATENCY_US, view, seen)))
    return others, detections


def _detection(
    fleet: FleetFrame, random: np.random.Generator, system: int, time: int, camera: Array
) -> tuple[CameraFovStatus, CameraTrackingGeo]:
    """Return what the camera of ``system`` at ``camera`` (3,), m, tells of an image at ``time`` (µs).

    The target walks east at 1.5 m/s. The noise is as the message says.
    """
    target = np.array([1.5e-6 * (time - _START_US), 0.0, 0.0])
    ray = target - camera
    distance, level = float(np.linalg.norm(ray)), hypot(ray[0], ray[1])
    along, across = _ALONG * distance, _ACROSS * distance
    left = np.array([-ray[1], ray[0], 0.0]) / level
    up = np.cross(ray / distance, left)
    noise = random.normal(size=3)
    seen = target + along * noise[0] * ray / distance + across * (noise[1] * left + noise[2] * up)
    source, cos, sin = Source(system, mavlink.MAV_COMP_ID_CAMERA), level / distance, abs(ray[2]) / distance
    view = CameraFovStatus(source, time, fleet.to_geodetic(camera), None, (1.0, 0.0, 0.0, 0.0), 1.2, 0.7)
    return view, CameraTrackingGeo(
        source,
        mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE,
        *fleet.to_geodetic(seen),
        None,
        horizontal_accuracy=hypot(along * cos, across * sin, across),
        vertical_accuracy=hypot(along * sin, across * cos),
        distance=distance,
        heading=atan2(ray[0], ray[1]),
        heading_accuracy=across / level,
    )


def _datagram(link: str, *messages: Message) -> Datagram:
    codec = Codec()
    return Datagram(link, b"".join(map(codec.encode, messages)))
