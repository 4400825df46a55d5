"""The shipped configuration, and scenarios that differ from it by a few keys."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from outrider.resources import config_root, find
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

LOGS = config_root() / "logs"
SCENARIOS = {path.stem: path for path in sorted((config_root() / "scenarios").glob("*.yaml"))}
FIREFLY = load(find("vehicles", "firefly"), VehicleConfig)


def scenario(name: str, **changes: Any) -> Scenario:
    """A shipped scenario, changed and checked again. Mappings are merged: ``starts={"jitter": 0.0}``."""
    base = load(SCENARIOS[name], Scenario).model_dump()
    return Scenario.model_validate(merged(base, changes))


def merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """``base`` with ``changes``, mapping by mapping."""
    result = deepcopy(base)
    for key, value in changes.items():
        inner = result.get(key)
        # A target of another kind has other keys: it replaces the old one.
        if isinstance(value, dict) and isinstance(inner, dict) and "kind" not in value:
            value = merged(inner, value)
        result[key] = value
    return result
