"""Scenes on which every planner is measured: each maps a seed to a scenario, which ``outrider`` also flies.

`places` gives the positions, the same as in ``outrider`` with the same seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import Array, Starts, starts
from outrider.scenarios.streams import Stream, stream
from outrider.yaml_files.yaml_file import load

VEHICLES, SIDE, HEIGHT, APART = 12, 12.0, 5.0, 1.5
"""Number of vehicles of a crowd, the side of its square (m), its height (m), and the least distance (m).

The distance holds for any two starts, and for any two goals.
"""
_TRIES = 100_000
"""Number of positions drawn before a square counts as full. Twelve vehicles need about twenty."""

Scene = Callable[[int], Scenario]


def antipodal_8(_seed: int) -> Scenario:
    """Return the shipped swap of eight on a circle of 8 m; the seed jitters the starts in `places`."""
    return _shipped("antipodal-8")


def antipodal_16(_seed: int) -> Scenario:
    """Return the shipped swap of sixteen on a circle of 12 m."""
    return _shipped("antipodal-16")


def crowd(seed: int) -> Scenario:
    """Return random starts and goals in a square; everything else is as in the swap of eight."""
    document = _shipped("antipodal-8").model_dump(mode="json")
    document |= {
        "name": f"crowd-{VEHICLES}",
        "description": f"{VEHICLES} vehicles, random starts and goals in a square of {SIDE:g} m, seed {seed}",
        "task": "goto",
        "vehicles": VEHICLES,
        "starts": {
            "kind": "points",
            "at": scattered(stream(seed, Stream.SCENE_STARTS)).tolist(),
            "goals": scattered(stream(seed, Stream.SCENE_GOALS)).tolist(),
        },
    }
    return Scenario.model_validate(document)


SCENES: Mapping[str, Scene] = {
    "antipodal-8": antipodal_8,
    "antipodal-16": antipodal_16,
    f"crowd-{VEHICLES}": crowd,
}


def places(scenario: Scenario, seed: int) -> Starts:
    """Return the starts and goals of all vehicles, as in a flight of ``outrider``."""
    return starts(scenario, seed, scenario.companion.planar)


def scattered(
    random: np.random.Generator, count: int = VEHICLES, side: float = SIDE, apart: float = APART
) -> Array:
    """Return positions (count, 3), fleet-local ENU, m, at `HEIGHT`, uniform in a square around the origin.

    A position is kept if it is ``apart`` from all before; values are whole millimetres. Raises InputError if
    there is no room.
    """
    found = np.empty((0, 2))
    for _ in range(_TRIES):
        place = np.round(random.uniform(-side / 2.0, side / 2.0, 2), 3) + 0.0
        if (np.linalg.norm(found - place, axis=1) >= apart).all():
            found = np.vstack([found, place])
        if len(found) == count:
            return np.column_stack([found, np.full(count, HEIGHT)])
    raise InputError(f"{count} places {apart:g} m apart are too many for a square of {side:g} m")


def _shipped(name: str) -> Scenario:
    return load(find("scenarios", name), Scenario)
