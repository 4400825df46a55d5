"""Selection of a vehicle's physics backend by its configuration."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from mavlink_bridge.frames import FleetFrame
from sitl.backends.physics import Physics, PhysicsName
from sitl.environment.turbulence import W20, Severity
from sitl.environment.weather import WeatherConfig
from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Vehicle, initial_states

_STREAM: Final = 0x4A
_CURVES: Final[dict[Severity, int]] = {"light": 3, "moderate": 4, "severe": 6}
"""Curves of figure 7 of MIL-F-8785C, which JSBSim uses above 1000 feet."""


class Start(NamedTuple):
    """Initial place and state of a vehicle."""

    position: FloatArray  # (3,) m, site NED
    yaw: float  # rad, site NED
    ground: float  # m, site NED, the z of the ground below it
    hovering: bool  # in the air, rather than with motors off


def physics(
    name: PhysicsName,
    config: VehicleConfig,
    start: Start,
    site: FleetFrame,
    weather: WeatherConfig,
    seed: int,
    system_id: int,
) -> Physics:
    """Return the vehicle in ``site``; ``seed`` (≥ 0) and ``system_id`` seed JSBSim's turbulence.

    Raises ValueError for a hover position on the ground or weather that this physics does not support,
    ModuleNotFoundError without JSBSim, and BackendError.
    """
    if name == "own":
        if weather.needs_jsbsim:
            raise ValueError(f"the weather has {weather.needs_jsbsim}, which needs physics: jsbsim")
        return Vehicle(config, start.position, start.yaw, start.ground, hovering=start.hovering)
    from sitl.backends.jsbsim_engine import Air
    from sitl.backends.jsbsim_place import Place
    from sitl.backends.jsbsim_vehicle import JsbsimVehicle

    state = initial_states(config, start.position, [start.yaw], start.ground, hovering=start.hovering)[0]
    w20 = weather.w20 if weather.turbulence_by == "jsbsim" else 0.0
    random = np.random.default_rng([seed, system_id, _STREAM])
    air = Air(w20, severity(w20), int(random.integers(1, 2**31)), isa=weather.atmosphere == "isa")
    return JsbsimVehicle(config, Place(site), state, start.ground, air=air)


def severity(w20: float) -> int:
    """Return the curve of the severity whose wind at 20 feet is nearest to ``w20`` (m/s); 0 for none."""
    if w20 == 0.0:
        return 0
    return min((abs(W20[name] - w20), curve) for name, curve in _CURVES.items())[1]
