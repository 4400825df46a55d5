"""Boxes and walls of the configuration as arrays."""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, radians, sin

import numpy as np

from companion.config.obstacles import Box, Obstacle, Wall
from companion.values.boxes import Boxes


def box_of(obstacle: Obstacle) -> Box | None:
    """Return the box that ``obstacle`` is; None if it is round."""
    if isinstance(obstacle, Wall):
        return obstacle.box
    return obstacle if isinstance(obstacle, Box) else None


def boxes_of(obstacles: Iterable[Obstacle]) -> Boxes:
    """Return the boxes and walls among ``obstacles``, in their order."""
    found = [box for one in obstacles if (box := box_of(one)) is not None]
    turns = [(cos(radians(box.yaw_deg)), sin(radians(box.yaw_deg))) for box in found]
    return Boxes(
        np.array([box.at for box in found], dtype=np.float64).reshape(-1, 3),
        0.5 * np.array([box.size for box in found], dtype=np.float64).reshape(-1, 3),
        np.array(turns, dtype=np.float64).reshape(-1, 2),
    )
