"""Worlds of posts and spheres for ways, and what holds for a way through one."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from companion.config.obstacles import Obstacle, Post, Sphere
from companion.config.planning import LimitsConfig
from companion.config.way import WayConfig
from companion.obstacles.static import FixedObstacles
from companion.values.horizon import Array
from companion.ways.clearance import Clearance
from companion.ways.grid import grid
from companion.ways.way import Way

BOX = LimitsConfig(box_min=(-10.0, -10.0, 3.0), box_max=(10.0, 10.0, 8.0))
LEAST = 0.6


def post(x: float, y: float, radius: float = 0.3, **more: Any) -> Post:
    return Post(kind="post", at=(x, y), radius=radius, **more)


def row(first: tuple[float, float], last: tuple[float, float], apart: float = 0.8) -> list[Obstacle]:
    """Posts side by side: a wall that no vehicle passes."""
    length = float(np.hypot(last[0] - first[0], last[1] - first[1]))
    shares = np.linspace(0.0, 1.0, int(np.ceil(length / apart)) + 1)
    line = np.array(first) + shares[:, None] * (np.array(last) - np.array(first))
    return [post(float(x), float(y)) for x, y in line]


POCKET = [*row((4.0, -5.0), (4.0, 5.0)), *row((-4.0, -5.0), (4.0, -5.0)), *row((-4.0, 5.0), (4.0, 5.0))]
"""A U that is open to the west."""
RING = [*POCKET, *row((-4.0, -5.0), (-4.0, 5.0))]


def drawn(seed: int, count: int = 30) -> list[Obstacle]:
    """Posts, some of them low, and spheres, all over the box."""
    random = np.random.default_rng([seed, count])
    found: list[Obstacle] = []
    for k in range(count):
        x, y = random.uniform(-9.0, 9.0, 2).tolist()
        radius, height = random.uniform(0.1, 1.0), random.uniform(4.0, 9.0)
        if k % 3:
            found.append(post(x, y, radius, height=height))
        else:
            found.append(Sphere(kind="sphere", at=(x, y, height), radius=radius))
    return found


def free_places(obstacles: Sequence[Obstacle], clearance: float, seed: int) -> Array:
    """Two places far apart (2, 3) with the clearance."""
    random, fixed = np.random.default_rng([seed, 7]), FixedObstacles(tuple(obstacles))
    while True:
        ends = random.uniform([-9.5, -9.5, 3.5], [9.5, 9.5, 7.5], (2, 3))
        if np.linalg.norm(ends[0] - ends[1]) > 8.0 and fixed.distance(ends).min() > clearance:
            return ends


def clearances(
    obstacles: Sequence[Obstacle], most: float = 2.0, cell: float = 0.5, limits: LimitsConfig = BOX
) -> Clearance:
    return Clearance(obstacles, grid(limits, cell, 150_000), most)


def way(obstacles: Sequence[Obstacle], limits: LimitsConfig = BOX, parts: int = 10, **settings: Any) -> Way:
    planar = settings.pop("planar", False)
    return Way(WayConfig(**settings), obstacles, limits, LEAST, parts, planar=planar)


def result(work: Generator[None, None, Any]) -> Any:
    """What the work returns when all its parts are done."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


def length(corners: Array) -> float:
    return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())


def least(obstacles: Sequence[Obstacle], corners: Array) -> float:
    """Clearance of a way, at places a centimetre apart."""
    fixed, found = FixedObstacles(tuple(obstacles)), np.inf
    for one, two in pairwise(corners):
        count = int(np.linalg.norm(two - one) / 0.01) + 2
        places = one + np.linspace(0.0, 1.0, count)[:, None] * (two - one)
        found = min(found, float(fixed.distance(places).min()))
    return found


def flown(leads: Way, start: Array, goal: Array, steps: int = 2000, by: float = 0.1) -> Array:
    """Places of a point that flies towards each sub-goal, a plan every ``by`` metres."""
    places = [start]
    for _ in range(steps):
        towards = leads.towards(places[-1], goal).place - places[-1]
        if not leads.clear:
            places.append(places[-1])
            continue
        far = float(np.linalg.norm(towards))
        places.append(places[-1] + towards * min(1.0, by / max(far, 1e-9)))
        if np.abs(places[-1] - goal).max() < 1e-6:
            break
    return np.array(places)
