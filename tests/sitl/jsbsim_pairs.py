"""The same vehicle twice, once with each physics, from the same state row; and what both are flown on."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import yaml

from mavlink_bridge.frames import FleetFrame
from sitl.backends.jsbsim_engine import STILL, Air
from sitl.backends.jsbsim_place import Place
from sitl.backends.jsbsim_vehicle import JsbsimVehicle
from sitl.vehicle.airframe import airframe, airframe_record
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, advance_many, command_row, initial_states

VEHICLES = ("firefly", "hummingbird")
SITE = FleetFrame(47.397742, 8.545594, 488.0)
PLACE = Place(SITE)
PERIOD = 4_000
"""µs: the step of the cross-check."""
HIGH = np.array([0.0, 0.0, -10.0])
CALM = np.zeros(3)


@cache
def vehicle(name: str, period: int = PERIOD) -> VehicleConfig:
    """A shipped vehicle, with another physics period."""
    path = Path(__file__).parents[2] / "config" / "vehicles" / f"{name}.yaml"
    document = yaml.safe_load(path.read_text())
    return VehicleConfig.model_validate({**document, "physics_period": period})


@cache
def gravity() -> float:
    """What falls at the site of JSBSim's Earth falls with this (m/s²): mass attracts, and the Earth turns."""
    config = vehicle("firefly")
    row = initial_states(config, HIGH, [0.0], 0.0)[0]
    falling = JsbsimVehicle(config, PLACE, row, 0.0)
    falling.advance(1, None)
    return float(falling.state.velocity[2]) / (PERIOD * 1e-6)


class Pair:
    """Both begin as the ``row`` says. Both controllers, and our physics, have JSBSim's gravity."""

    def __init__(self, config: VehicleConfig, row: np.ndarray, air: Air = STILL) -> None:
        self.jsbsim = JsbsimVehicle(config, PLACE, row, 0.0, gravity(), air)
        self.own = row[None].copy()
        self._airframe = airframe_record(airframe(config, gravity()))
        self.apart: list[float] = []

    def advance(self, steps: int, reference: Reference | None, wind: np.ndarray = CALM) -> None:
        """Ours flies in the wind that JSBSim made of ``wind``."""
        track = self.jsbsim.advance(steps, reference, wind)
        command = command_row(reference, wind=self.jsbsim.air)[None]
        own = advance_many(self.own, command, self._airframe, steps)[0]
        self.apart += np.linalg.norm(track - own, axis=1).tolist()

    @property
    def turned_apart(self) -> float:
        """Angle (deg) between their attitudes."""
        p, q = self.jsbsim.state.attitude, self.own[0, 6:10]
        return float(np.degrees(4.0 * np.arcsin(0.5 * np.linalg.norm(p - np.copysign(1.0, p @ q) * q))))


def tumble(config: VehicleConfig, rates: tuple[float, float, float]) -> Pair:
    """Ten seconds with the motors off."""
    row = initial_states(config, [0.0, 0.0, -1000.0], [0.3], 0.0)[0]
    row[3:6], row[10:13] = (1.0, -2.0, 3.0), rates
    pair = Pair(config, row)
    pair.advance(10_000_000 // PERIOD, None)
    return pair


def step(config: VehicleConfig, way: tuple[float, float, float]) -> Pair:
    """Ten seconds after the reference has jumped."""
    row = initial_states(config, HIGH, [0.3], 0.0, hovering=True, gravity=gravity())[0]
    pair = Pair(config, row)
    pair.advance(10_000_000 // PERIOD, Reference.hover(HIGH + way, 0.3))
    return pair


def lap(t: float) -> Reference:
    """A circle of 5 m at 5 m/s, rising and sinking, the nose turning: with its derivatives."""
    a, r, w = t, 5.0, 1.0
    c, s, cd, sd = np.cos(a), np.sin(a), np.cos(0.5 * a), np.sin(0.5 * a)
    return Reference(
        HIGH + np.array([r * (c - 1.0), r * s, -sd]),
        np.array([-r * w * s, r * w * c, -0.5 * cd]),
        np.array([-r * w**2 * c, -r * w**2 * s, 0.25 * sd]),
        np.array([r * w**3 * s, -r * w**3 * c, 0.125 * cd]),
        yaw=0.3 + 0.2 * t,
        yaw_rate=0.2,
    )


def laps(
    config: VehicleConfig, wind: Callable[[int], np.ndarray], air: Air = STILL, seconds: float = 60.0
) -> Pair:
    """Laps in a wind (m/s, NED) that is told by the time (µs)."""
    row = initial_states(config, HIGH, [0.3], 0.0, hovering=True, gravity=gravity())[0]
    pair = Pair(config, row, air)
    for k in range(round(seconds * 1e6) // PERIOD):
        pair.advance(1, lap(k * PERIOD * 1e-6), wind(k * PERIOD))
    return pair
