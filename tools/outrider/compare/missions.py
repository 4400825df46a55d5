"""Starts and goals of a flight: drawn at random for a seed, or read from mission files of LSC's planners.

A mission file is JSON with a list ``agents``, each with ``start`` and ``goal`` (x, y, z, m). ``quadrotors``,
``world`` and ``obstacles`` of the file are not read, because the comparison has the limits and the box.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from outrider.compare.comparison import Measure, Missions
from outrider.compare.measures import scaled
from outrider.errors import Fault, InputError
from outrider.scenarios.part import Position
from outrider.scenarios.streams import Stream, stream

Array = NDArray[np.float64]
_ROUNDS, _BATCH = 400, 64
"""Number of batches of candidates after which a draw begins anew, and candidates in a batch."""
_ATTEMPTS = 60
"""Number of draws, each from its own start, until there is no room."""
_MOST_BYTES = 4_000_000


class Mission(NamedTuple):
    """Starts and goals (K, 3), m, ENU."""

    starts: Array
    goals: Array


class _Agent(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
    start: Position
    goal: Position


class _File(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
    agents: Annotated[tuple[_Agent, ...], Field(min_length=1, max_length=244)]


def drawn(missions: Missions, measure: Measure, count: int, seed: int) -> Mission:
    """Return the mission of ``count`` vehicles that ``seed`` draws, in whole millimetres.

    Raises InputError if there is no room.
    """
    starts = _scatter(missions, measure, count, seed, Stream.SCENE_STARTS, "starts")
    goals = _scatter(missions, measure, count, seed, Stream.SCENE_GOALS, "goals", starts)
    return Mission(starts, goals)


def _scatter(
    missions: Missions,
    measure: Measure,
    count: int,
    seed: int,
    of: Stream,
    what: str,
    about: Array | None = None,
) -> Array:
    """Return ``count`` places (count, 3), m; each is ``missions.near`` one of ``about`` (count, 3), m."""
    for attempt in range(_ATTEMPTS):
        random = stream(seed, of, attempt)
        placed = np.empty((0, 3))
        for _ in range(_ROUNDS):
            found = np.round(random.uniform(missions.low, missions.high, size=(_BATCH, 3)), 3) + 0.0
            off = scaled(found[:, None] - placed[None], measure)
            fits = (off >= missions.apart).all(axis=1)
            if about is not None and missions.near is not None:
                fits &= np.linalg.norm(found - about[len(placed)], axis=1) <= missions.near
            free = np.flatnonzero(fits)
            if free.size:
                placed = np.vstack([placed, found[free[0]]])
                if len(placed) == count:
                    return placed
    sides = " × ".join(f"{high - low:g}" for low, high in zip(missions.low, missions.high, strict=True))
    raise InputError(
        f"seed {seed}: there is no room for {count} {what} {missions.apart:g} m apart in {sides} m; allowed:"
        " fewer vehicles, or less apart"
    )


def folder_of(path: Path, count: int, offset: Position = (0.0, 0.0, 0.0)) -> list[Mission]:
    """Return the missions of ``count`` vehicles in ``path``, in the order of the numbers in their names.

    The files are in ``path`` or below it. ``offset`` (m) is added to all places. Raises
    InputError for a file that is no mission, and without any.
    """
    if not path.is_dir():
        raise InputError(f"--missions {path}: there is no such folder")
    files = sorted(path.rglob("*.json"), key=lambda file: _numbers(str(file.relative_to(path))))
    found = [mission for file in files if len((mission := read(file)).starts) == count]
    if not found:
        raise InputError(f"--missions {path}: {len(files)} files, but none has {count} vehicles")
    return [Mission(one.starts + offset, one.goals + offset) for one in found]


def read(path: Path) -> Mission:
    """Return the mission of a file. Raises InputError with the place of the first fault."""
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
        raise InputError(Fault(str(path), f"{where or 'the file'}: {first['msg']}")) from None
    return Mission(np.array([one.start for one in agents]), np.array([one.goal for one in agents]))


def _numbers(name: str) -> tuple[list[int], str]:
    return [int(digits) for digits in re.findall(r"\d+", name)], name
