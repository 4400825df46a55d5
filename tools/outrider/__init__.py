"""Escort of a moving target by a ring of drones: planner, simulation and whole flights for Python programs.

``Planner`` plans for one vehicle in a loop, ``fly`` flies a scenario, ``sim`` has the vehicles' physics. The
names in ``__all__`` are the public interface, which follows semantic versioning (docs/api.md); all other
modules are internal. Names are imported when they are first used, so that the command line starts quickly.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from companion.avoidance.field.methods import Influence, Method, Scene
    from companion.config.obstacles import Box, Post, Sphere, Wall
    from outrider import sim
    from outrider.errors import InputError, OutriderError
    from outrider.flights.flight import Flight
    from outrider.flights.flying import fly, scenario
    from outrider.planner.own_parts import OwnSurface as Surface
    from outrider.planner.planner import Planner
    from outrider.planner.planner_config import PlannerConfig
    from outrider.planner.values import Motion, Neighbour, Obstacle, Plan, Setpoint, Step, Target
    from outrider.scenarios.scenario import Scenario

    __version__: str

__all__ = [
    "Box",
    "Flight",
    "Influence",
    "InputError",
    "Method",
    "Motion",
    "Neighbour",
    "Obstacle",
    "OutriderError",
    "Plan",
    "Planner",
    "PlannerConfig",
    "Post",
    "Scenario",
    "Scene",
    "Setpoint",
    "Sphere",
    "Step",
    "Surface",
    "Target",
    "Wall",
    "__version__",
    "fly",
    "scenario",
    "sim",
]

_PLACES = {
    "Box": "companion.config.obstacles:Box",
    "Flight": "outrider.flights.flight:Flight",
    "Influence": "companion.avoidance.field.methods:Influence",
    "InputError": "outrider.errors:InputError",
    "Method": "companion.avoidance.field.methods:Method",
    "Motion": "outrider.planner.values:Motion",
    "Neighbour": "outrider.planner.values:Neighbour",
    "Obstacle": "outrider.planner.values:Obstacle",
    "OutriderError": "outrider.errors:OutriderError",
    "Plan": "outrider.planner.values:Plan",
    "Planner": "outrider.planner.planner:Planner",
    "PlannerConfig": "outrider.planner.planner_config:PlannerConfig",
    "Post": "companion.config.obstacles:Post",
    "Scenario": "outrider.scenarios.scenario:Scenario",
    "Scene": "companion.avoidance.field.methods:Scene",
    "Setpoint": "outrider.planner.values:Setpoint",
    "Sphere": "companion.config.obstacles:Sphere",
    "Step": "outrider.planner.values:Step",
    "Surface": "outrider.planner.own_parts:OwnSurface",
    "Target": "outrider.planner.values:Target",
    "Wall": "companion.config.obstacles:Wall",
    "fly": "outrider.flights.flying:fly",
    "scenario": "outrider.flights.flying:scenario",
}
"""Module and name of each public name."""


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("outrider")
    elif name == "sim":
        value = import_module("outrider.sim")
    elif name in _PLACES:
        module, _, attribute = _PLACES[name].partition(":")
        if module != "outrider.errors":
            from outrider.terminal.compilation import log_if_compiling

            log_if_compiling()
        value = getattr(import_module(module), attribute)
    else:
        raise AttributeError(f"module 'outrider' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, whether they have been used or not."""
    return list(__all__)
