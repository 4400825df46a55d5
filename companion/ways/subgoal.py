"""Place to aim for on the way to a goal."""

from __future__ import annotations

from typing import NamedTuple

from companion.values.horizon import Array


class Subgoal(NamedTuple):
    """Place (3,), m, to aim for now; ``beyond`` (m): length of the way from there to the goal."""

    place: Array
    beyond: float
