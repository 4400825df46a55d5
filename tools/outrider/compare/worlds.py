"""Worlds of comparisons: obstacles drawn for a seed, or read from the files of a folder."""

from __future__ import annotations

import re
from math import ceil, cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.config.obstacles import Box, Obstacle, Post, Sphere
from companion.config.planning import LimitsConfig
from companion.obstacles.static import FixedObstacles
from companion.ways.clearance import clearance_of
from companion.ways.search import Search
from outrider.compare.world import Forest, Maze, Pillars, World
from outrider.errors import InputError
from outrider.scenarios.streams import Stream, stream
from outrider.scenarios.world_file import read_world

Array = NDArray[np.float64]
_DRAWS, _CANDIDATES = 200, 2000
"""Number of worlds that are drawn until there is none, and of places that are tried in each."""
_CELL_M, _MOST_CELLS = 0.1, 250_000
"""Grid on which ways are searched."""
_ALL_CELLS = 1 << 60


def drawn(world: World, starts: Array, goals: Array, limits: LimitsConfig, seed: int) -> list[Obstacle]:
    """Return the obstacles that ``seed`` draws, in whole millimetres.

    ``starts``, ``goals`` (K, 3), m, stay free, and each vehicle has a way within ``limits``. Raises
    InputError if no such world is found.
    """
    for attempt in range(_DRAWS):
        random = stream(seed, Stream.SCENE_OBSTACLES, attempt)
        if isinstance(world, Maze):
            found = _maze(world, random)
            if found:
                return found
            continue
        ends = np.concatenate([starts, goals])
        scattered = (
            _forest(world, ends, random) if isinstance(world, Forest) else _pillars(world, ends, random)
        )
        if scattered is not None and _passable(scattered, starts, goals, limits, world.passable):
            return scattered
    raise InputError(
        f"seed {seed}: none of {_DRAWS} worlds ({world.kind}) leaves starts and goals free and each vehicle a"
        " way; allowed: fewer or smaller obstacles"
    )


def folder_of(path: Path) -> dict[str, list[Obstacle]]:
    """Return the worlds of the files ``*.csv`` in ``path`` by name, in the order of the numbers in these.

    Raises InputError for a file that is no world, and without any.
    """
    if not path.is_dir():
        raise InputError(f"--worlds {path}: there is no such folder")
    files = sorted(
        path.glob("*.csv"), key=lambda file: [int(digits) for digits in re.findall(r"\d+", file.name)]
    )
    if not files:
        raise InputError(f"--worlds {path}: there is no file *.csv")
    return {file.name: list(read_world(file)) for file in files}


def _forest(world: Forest, ends: Array, random: np.random.Generator) -> list[Obstacle] | None:
    found: list[Obstacle] = []
    for place in _places(world, random):
        if len(found) == world.count:
            break
        box = Box(kind="box", at=(*place, round(0.5 * world.size[2], 4)), size=world.size)
        if FixedObstacles([box]).distance(ends).min() >= world.clear:
            found.append(box)
    return found if len(found) == world.count else None


def _pillars(world: Pillars, ends: Array, random: np.random.Generator) -> list[Obstacle] | None:
    found: list[Obstacle] = []
    axes = np.empty((0, 2))
    count = 0
    for place in _places(world, random):
        if count == world.count + world.rings:
            break
        if (np.linalg.norm(axes - place, axis=1) < world.gap).any():
            continue
        one = _post(world, place, random) if count < world.count else _ring(world, place, random)
        if FixedObstacles(one).distance(ends).min() >= world.clear:
            found += one
            axes = np.vstack([axes, place])
            count += 1
    return found if count == world.count + world.rings else None


def _places(world: Forest | Pillars, random: np.random.Generator) -> list[tuple[float, float]]:
    places = np.round(random.uniform(world.low, world.high, size=(_CANDIDATES, 2)), 3) + 0.0
    return [(x, y) for x, y in places.tolist()]


def _post(world: Pillars, place: tuple[float, float], random: np.random.Generator) -> list[Obstacle]:
    radius = round(float(random.uniform(*world.radius)), 3)
    return [Post(kind="post", at=place, radius=radius, height=world.height)]


def _ring(world: Pillars, place: tuple[float, float], random: np.random.Generator) -> list[Obstacle]:
    """Return a chain of balls, each of which touches the next."""
    radius, height = float(random.uniform(*world.ring_radius)), float(random.uniform(*world.ring_height))
    yaw, ball = float(random.uniform(0.0, pi)), 0.5 * world.ring_thickness
    count = ceil(pi * radius / ball)
    found: list[Obstacle] = []
    for angle in (2.0 * pi * k / count for k in range(count)):
        across, up = radius * cos(angle), radius * sin(angle)
        at = (place[0] + across * cos(yaw), place[1] + across * sin(yaw), height + up)
        found.append(Sphere(kind="sphere", at=_rounded(at), radius=ball))
    return found


def _rounded(at: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = at
    return round(x, 3), round(y, 3), round(z, 3)


def _maze(world: Maze, random: np.random.Generator) -> list[Obstacle]:
    """Return the closed cells as boxes; nothing if the maze is not as asked for."""
    opened = np.zeros((world.columns, world.rows), dtype=np.bool_)
    begin = (1, int(random.integers(1, world.rows - 1)))
    opened[0, begin[1]] = opened[begin] = True
    path = [begin]
    while path:
        x, y = path[-1]
        beside = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        fresh = [one for one in beside if _may_open(opened, one)]
        if fresh:
            path.append(fresh[int(random.integers(len(fresh)))])
            opened[path[-1]] = True
        else:
            path.pop()
    ends = np.flatnonzero(opened[-2])
    if not len(ends):
        return []
    opened[-1, random.choice(ends)] = True
    closed: list[Any] = np.argwhere(~opened).tolist()
    fewest, most = world.closed
    return [_cell(world, column, row) for column, row in closed] if fewest <= len(closed) <= most else []


def _may_open(opened: NDArray[np.bool_], cell: tuple[int, int]) -> bool:
    """Return whether an inner, closed ``cell`` has one open neighbour."""
    (x, y), (columns, rows) = cell, opened.shape
    if not (0 < x < columns - 1 and 0 < y < rows - 1) or opened[x, y]:
        return False
    return int(opened[x - 1, y]) + int(opened[x + 1, y]) + int(opened[x, y - 1]) + int(opened[x, y + 1]) == 1


def _cell(world: Maze, column: int, row: int) -> Box:
    x, y = world.first[0] + column * world.cell, world.first[1] + row * world.cell
    return Box(
        kind="box",
        at=(round(x, 4), round(y, 4), round(0.5 * world.height, 4)),
        size=(world.cell, world.cell, world.height),
    )


def _passable(
    obstacles: list[Obstacle], starts: Array, goals: Array, limits: LimitsConfig, clearance: float
) -> bool:
    """Return whether each vehicle has a way of the ``clearance`` (m) at the height of its start."""
    for start, goal in zip(starts, goals, strict=True):
        clear = clearance_of(tuple(obstacles), limits, _CELL_M, _MOST_CELLS, clearance, float(start[2]))
        first, last = (int(clear.grid.nearest(place)) for place in (start, goal))
        search = Search(clear, clearance, first, last)
        search.go_on(_ALL_CELLS)
        if search.cells() is None:
            return False
    return True
