"""Selection of a vehicle's physics backend by name."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from mavlink_bridge.frames import FleetFrame
from sitl.backends.physics import Physics, PhysicsName
from sitl.backends.point_vehicle import PointVehicle
from sitl.environment.turbulence import W20, Severity
from sitl.environment.weather import WeatherConfig
from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Vehicle, initial_states

# Separates these random numbers from those of the vehicle's sensors and weather, which have the same seeds.
_RNG_STREAM_ID: Final = 0x4A
# JSBSim's severity index: the curve of figure 7 of MIL-F-8785C, which JSBSim uses above 1000 feet.
_SEVERITY_INDEX: Final[dict[Severity, int]] = {"light": 3, "moderate": 4, "severe": 6}


class Start(NamedTuple):
    """Initial place and state of a vehicle."""

    position: FloatArray  # (3,) m, site NED
    yaw: float  # rad, site NED
    ground: float  # m, site NED, the z of the ground below it
    hovering: bool  # at hover speed of the motors in the air; False: motors off


def physics(
    name: PhysicsName,
    config: VehicleConfig,
    start: Start,
    site: FleetFrame,
    weather: WeatherConfig,
    seed: int,
    system_id: int,
) -> Physics:
    """Return the vehicle with the physics ``name``.

    ``seed`` (≥ 0) and ``system_id`` seed JSBSim's turbulence. ``site`` is the frame of ``start``; only JSBSim
    uses it. Raises ValueError for a hover position on the ground or for weather that needs JSBSim; with
    JSBSim also ModuleNotFoundError if it is not installed, and BackendError if it refuses the vehicle. A
    point is moved by no physics, and with JSBSim raises ValueError.
    """
    if config.motion == "point" and name != "own":
        raise ValueError(f"{config.name} is a point, which needs physics: own")
    if name == "own":
        if weather.needs_jsbsim:
            raise ValueError(f"the weather has {weather.needs_jsbsim}, which needs physics: jsbsim")
        if config.motion == "point":
            return PointVehicle(config, start.position, start.yaw, start.ground, hovering=start.hovering)
        return Vehicle(config, start.position, start.yaw, start.ground, hovering=start.hovering)
    from sitl.backends.jsbsim_engine import Air
    from sitl.backends.jsbsim_place import Place
    from sitl.backends.jsbsim_vehicle import JsbsimVehicle

    state = initial_states(config, start.position, [start.yaw], start.ground, hovering=start.hovering)[0]
    w20 = weather.w20 if weather.turbulence_by == "jsbsim" else 0.0
    random = np.random.default_rng([seed, system_id, _RNG_STREAM_ID])
    air = Air(w20, severity(w20), int(random.integers(1, 2**31)), isa=weather.atmosphere == "isa")
    return JsbsimVehicle(config, Place(site), state, start.ground, air=air)


def severity(w20: float) -> int:
    """Return JSBSim's severity index whose wind at 20 feet is nearest to ``w20`` (m/s); 0 for no wind."""
    if w20 == 0.0:
        return 0
    return min((abs(W20[name] - w20), index) for name, index in _SEVERITY_INDEX.items())[1]
