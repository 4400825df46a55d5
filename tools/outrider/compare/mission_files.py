"""Mission files of LSC's planners: starts and goals of flights.

A mission file is JSON with a list ``agents``, each with ``start`` and ``goal`` (x, y, z, m). ``quadrotors``,
``world`` and ``obstacles`` of the file are not read, because the comparison has the limits and the box.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from outrider.compare.comparison import Measure
from outrider.compare.json_places import place_of
from outrider.compare.measures import scaled
from outrider.compare.missions import Mission
from outrider.errors import Fault, InputError
from outrider.scenarios.part import Position

Array = NDArray[np.float64]
_MOST_BYTES = 4_000_000


class _Agent(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
    start: Position
    goal: Position


class _File(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
    agents: Annotated[tuple[_Agent, ...], Field(min_length=1, max_length=244)]


def folder_of(path: Path, count: int, measure: Measure, offset: Position = (0.0, 0.0, 0.0)) -> list[Mission]:
    """Return the missions of ``count`` vehicles in ``path``, in the order of the numbers in their names.

    The files are in ``path`` or below it. ``offset`` (m) is added to all places. Raises InputError for a
    file that is no mission, or in which two vehicles overlap in ``measure``, and without any.
    """
    if not path.is_dir():
        raise InputError(f"--missions {path}: there is no such folder")
    files = sorted(path.rglob("*.json"), key=lambda file: _numbers(str(file.relative_to(path))))
    found = [mission for file in files if len((mission := read(file, measure)).starts) == count]
    if not found:
        raise InputError(f"--missions {path}: {len(files)} files, but none has {count} vehicles")
    return [Mission(one.starts + offset, one.goals + offset) for one in found]


def read(path: Path, measure: Measure) -> Mission:
    """Return the mission of a file.

    Raises InputError with the place of the first fault: it is no mission, or two starts or two goals are
    nearer in ``measure`` than where vehicles collide.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(f"{path}: more than {_MOST_BYTES} bytes; no mission is as large")
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    try:
        document = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        line = getattr(error, "lineno", 1)
        raise InputError(
            f"{path}:{line}:{getattr(error, 'colno', 1)}: no JSON: {getattr(error, 'msg', error)}"
        ) from None
    except ValueError as error:
        raise InputError(f"{path}: no JSON: {error}") from None
    try:
        agents = _File.model_validate(document).agents
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        fault = Fault(str(path), f"{where or 'the file'}: {first['msg']}", *place_of(text, first["loc"]))
        raise InputError(fault) from None
    found = Mission(np.array([one.start for one in agents]), np.array([one.goal for one in agents]))
    for name, places in zip(("start", "goal"), found, strict=True):
        _refuse_overlap(str(path), text, name, places, measure)
    return found


def _refuse_overlap(file: str, text: str, name: str, places: Array, measure: Measure) -> None:
    """Raise InputError for the first two of ``places`` (K, 3), m, at which vehicles collide."""
    first, second = np.triu_indices(len(places), 1)
    apart = scaled(places[first] - places[second], measure)
    for k in np.flatnonzero(apart < measure.least)[:1]:
        one, two = int(first[k]), int(second[k])
        what = (
            f"agents.{two}.{name} is {apart[k]:.3g} m from agents.{one}.{name} in the scene's measure;"
            f" allowed: at least {measure.least:g} m"
        )
        raise InputError(Fault(file, what, *place_of(text, ("agents", two, name))))


def _numbers(name: str) -> tuple[list[int], str]:
    return [int(digits) for digits in re.findall(r"\d+", name)], name
