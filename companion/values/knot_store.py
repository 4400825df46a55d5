"""Knots of plans in one array for all vehicles of a process: each plan is stored once, whoever knows it."""

from __future__ import annotations

from functools import partial
from threading import Lock
from weakref import ref

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FIRST_ROWS = 64


class KnotStore:
    """Rows of ``knots`` (S, k, 9), each with the knots of one plan and undefined values behind them.

    A row is free for another plan as soon as nobody holds the plan's array any more. Flights in several
    threads may use one store; read ``knots`` after ``row_of``.
    """

    def __init__(self) -> None:
        self.knots: Array = np.zeros((_FIRST_ROWS, 1, 9))
        self._rows: dict[int, int] = {}
        self._references: dict[int, ref[Array]] = {}
        self._free = list(range(_FIRST_ROWS))
        self._adding = Lock()

    def row_of(self, knots: Array) -> int:
        """Return the row of ``knots`` (n, 9), an array that does not change any more.

        The row is valid as long as somebody holds this array.
        """
        row = self._rows.get(id(knots))
        return self._add(knots) if row is None else row

    def _add(self, knots: Array) -> int:
        with self._adding:
            row = self._rows.get(id(knots))
            return self._stored(knots) if row is None else row

    def _stored(self, knots: Array) -> int:
        rows, longest, _ = self.knots.shape
        further = max(len(knots) - longest, 0)
        if not self._free or further:
            more = 0 if self._free else rows
            self.knots = np.pad(self.knots, ((0, more), (0, further), (0, 0)))
            self._free += range(rows, rows + more)
        key, row = id(knots), self._free.pop()
        self.knots[row, : len(knots)] = knots
        self._rows[key] = row
        self._references[key] = ref(knots, partial(self._release, key))
        return row

    def _release(self, key: int, _reference: object) -> None:
        """Release the row of an array that is gone.

        It takes no lock: it may be called at any time, also within ``_stored``, and only adds a free row.
        """
        del self._references[key]
        self._free.append(self._rows.pop(key))


STORE = KnotStore()
"""The store of this process."""
