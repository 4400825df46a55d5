"""Selection of the gallery: each shipped scenario with each method of the paper, and certified."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from outrider.errors import InputError
from outrider.resources import config_root
from outrider.sweep.cells import Cell, cells
from outrider.sweep.grid import Sweep

WAYS = ("baseline", "swivel", "approach_angle", "tangential", "certified")
"""The four methods of the paper, and the certified avoidance."""


class GalleryPanel(NamedTuple):
    """One panel: a scenario flown in one of ``WAYS``."""

    scenario: str
    way: str


def scenarios() -> tuple[str, ...]:
    """Return the names of the shipped scenarios, sorted."""
    return tuple(sorted(path.stem for path in Path(config_root(), "scenarios").glob("*.yaml")))


def chosen(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return ``names``, or all scenarios if it is empty. Raises InputError for a name that is not shipped."""
    known = scenarios()
    for name in names:
        if name not in known:
            raise InputError(f"scenario {name!r} is not shipped; allowed: {', '.join(known)}")
    return tuple(dict.fromkeys(names)) or known


def showings(names: tuple[str, ...]) -> tuple[GalleryPanel, ...]:
    """Return each scenario in each of ``WAYS``."""
    return tuple(GalleryPanel(name, way) for name in names for way in WAYS)


def cells_of(shown: tuple[GalleryPanel, ...]) -> list[Cell]:
    """Return the cell of each panel: the shipped scenario with the panel's ``way``, started in the air."""
    found = []
    for number, (scenario, way) in enumerate(shown, 1):
        other = {"companion.avoidance": "certified"} if way == "certified" else {"companion.methods": [way]}
        spec = Sweep(name="gallery", scenarios=(scenario,), set={"airborne": True, **other})
        (cell,) = cells(spec, f"{scenario} by {way}")
        found.append(cell._replace(label=f"{scenario}, {way}", slug=f"{number:03d}-{scenario}-{way}"))
    return found
