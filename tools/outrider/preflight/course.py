"""Course of a flight alone: from one corner of a box along each of its edges there and back."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from outrider.errors import InputError

_LEAST, _MOST = 4.0, 60.0
"""Length (m) of a horizontal edge: on a shorter one the accelerations of plans are not reached."""
_LEAST_UP, _MOST_UP = 1.0, 20.0


class Box(NamedTuple):
    """Edges (m) from the place above the start: towards east, north and up; negative ones the other way.

    ``up`` is 0 if the height is not flown.
    """

    east: float = 8.0
    north: float = 8.0
    up: float = 3.0

    def places(self, corner: Array) -> list[Array]:
        """Return the places (3,), m, to fly to, from ``corner`` (3,) on: along each edge there and back."""
        edges = np.diag(self)
        return [place for edge in edges if edge.any() for place in (corner + edge, corner)]


NO_BOX: Final = Box(0.0, 0.0, 0.0)


def box_of(text: str, *, planar: bool) -> Box:
    """Return the box of the option ``--box``; without height if ``planar``. Raises InputError."""
    try:
        east, north, up = (float(part) for part in text.split(","))
    except ValueError:
        east = north = up = float("nan")
    fits = all(_LEAST <= abs(edge) <= _MOST for edge in (east, north)) and _LEAST_UP <= up <= _MOST_UP
    if not fits:
        raise InputError(
            f"--box {text}: allowed: EAST,NORTH,UP in m, such as 8,8,3: {_LEAST:g} to {_MOST:g} or negative"
            f" ones, and {_LEAST_UP:g} to {_MOST_UP:g} up"
        )
    return Box(east, north, 0.0 if planar else up)


def outside(places: list[Array], limits: LimitsConfig) -> str:
    """Return which place lies outside the box of ``limits``, or an empty string."""
    for place in places:
        if (place < limits.box_min).any() or (place > limits.box_max).any():
            x, y, z = place.tolist()
            return f"the course is outside limits.box: {x:.1f} m east, {y:.1f} m north, {z:.1f} m up"
    return ""
