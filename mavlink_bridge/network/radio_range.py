"""Radio range of a channel: who hears whom, by the true places of its members."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.float64]


class RadioRange:
    """Radio range of ``most`` (m) between nodes: the edge is sharp, and the distance itself is within it.

    ``places``: function of the time (µs) that returns the true places (M, 3), m, of the nodes ``names``.
    """

    def __init__(self, most: float, names: Sequence[str], places: Callable[[int], Places]) -> None:
        self._names, self._places = np.array(list(names)), places
        self._rows = {name: row for row, name in enumerate(names)}
        self._most_squared = most * most
        self._now = -1
        self._there: Places = np.empty((0, 3))
        self._hearing: dict[str, frozenset[str]] = {}

    def hearing(self, now: int, sender: str) -> frozenset[str]:
        """Return the nodes that are within range of ``sender`` at ``now`` (µs), ``sender`` among them."""
        if now != self._now:
            self._now, self._there = now, self._places(now)
            self._hearing.clear()
        found = self._hearing.get(sender)
        if found is None:
            apart = self._there - self._there[self._rows[sender]]
            near = np.einsum("ij,ij->i", apart, apart) <= self._most_squared
            found = self._hearing[sender] = frozenset(self._names[near].tolist())
        return found
