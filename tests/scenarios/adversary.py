"""A rogue node on the swarm link: fifty times a second it says that a vehicle is where it would press another
one out of its box."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import yaml

from companion.values.horizon import Array
from companion.values.phase import Phase
from mavlink_bridge.messages import GlobalPosition, SetpointLocal, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.resources import find
from tests.scenarios.single_vehicle import BOOT, SITE, SYSTEM, TICK, SingleVehicle

Place = Callable[[float, Array, np.random.Generator], Array]
"""Where it says that it is (3,), m ENU: after so many seconds, and of a victim at a place (3,)."""

_UP = np.array([0.0, 0.0, 1.0])


def _above(_time: float, victim: Array, _chance: np.random.Generator) -> Array:
    return victim + _UP


def _below(_time: float, victim: Array, _chance: np.random.Generator) -> Array:
    return victim - _UP


def _sinking(time: float, victim: Array, _chance: np.random.Generator) -> Array:
    return np.array([victim[0], victim[1], max(9.0 - 0.7 * time, 0.5)])


def _circling(time: float, victim: Array, _chance: np.random.Generator) -> Array:
    return victim + np.array([1.2 * np.cos(2.0 * time), 1.2 * np.sin(2.0 * time), 0.8])


def _around(time: float, victim: Array, _chance: np.random.Generator) -> Array:
    """From all sides, one after the other."""
    turn, rise = 5.0 * time, 1.3 * time
    return victim + 1.1 * np.array([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)])


def _jumping(time: float, victim: Array, chance: np.random.Generator) -> Array:
    """Somewhere else near it every half second, mostly above."""
    chance = np.random.default_rng([int(2.0 * time), int(chance.bit_generator.seed_seq.entropy)])
    off = chance.normal(size=3) + 0.7 * _UP
    return victim + off / np.linalg.norm(off)


def descending(time: float, _victim: Array, _chance: np.random.Generator) -> Array:
    """Somebody innocent who comes down on the way, from 12 m to 3.6 m, and stays."""
    return np.array([0.0, 0.0, max(12.0 - 0.8 * time, 3.6)])


ADVERSARIES: dict[str, Place] = {
    "above": _above,
    "below": _below,
    "sinking": _sinking,
    "circling": _circling,
    "from all sides": _around,
    "jumping": _jumping,
}


class Pressed(NamedTuple):
    """Of a flight: set-points and true places, (n, 3) m and m/s, fleet-local ENU."""

    asked: Array
    speeds: Array
    places: Array


def shipped(name: str) -> dict[str, Any]:
    """The settings of the companion file of that name."""
    settings: dict[str, Any] = yaml.safe_load(find("companions", name).read_text())["companion"]
    return settings


class Rogue:
    """Beside ``vehicle`` from now on."""

    def __init__(self, vehicle: SingleVehicle, place: Place, seed: int) -> None:
        self._vehicle, self._place = vehicle, place
        self._chance = np.random.default_rng(seed)
        self._writer = Codec()
        self._began = vehicle.now
        self._last: Array | None = None

    def datagram(self) -> Datagram:
        """What it says now."""
        vehicle = self._vehicle
        time = 1e-6 * (vehicle.now - self._began)
        place = self._place(time, vehicle.place, self._chance)
        last = place if self._last is None else self._last
        east, north, up = (place - last) / 0.02
        self._last = place
        fast = float(np.linalg.norm([east, north, up]))
        velocity = (0.0, 0.0, 0.0) if fast > 10.0 else (float(north), float(east), float(-up))
        latitude, longitude, altitude = SITE.to_geodetic(place)
        return Datagram(
            "swarm",
            self._writer.encode(
                GlobalPosition(
                    Source(77, 195), vehicle.now - BOOT, latitude, longitude, altitude, 0.0, velocity, None
                )
            ),
        )


def press(vehicle: SingleVehicle, place: Place, seconds: float, seed: int) -> Pressed:
    """Fly ``seconds`` beside such a node."""
    rogue, begin = Rogue(vehicle, place, seed), len(vehicle.sent)
    places = []
    for tick in range(round(seconds * 1e6 / TICK)):
        if tick % 2 == 0:
            vehicle.besides.append(rogue.datagram())
        vehicle.step()
        places.append(vehicle.place)
    assert vehicle.phase is Phase.ESCORT
    told = [m for _, _, m in vehicle.sent[begin:] if isinstance(m, SetpointLocal)]
    local = vehicle.companion.world.at(vehicle.now).local
    assert local is not None
    assert {m.target_system for m in told} == {SYSTEM}
    return Pressed(
        np.array([local.position_to_fleet(m.position) for m in told]),
        np.array([local.velocity_to_fleet(m.velocity) for m in told]),
        np.array(places),
    )
