"""What the processes of a real-time run show to who looks on, and what is wished of them: a page of memory.

As on the ``Board`` each row is written by one process; a reader may see one half old and half new. It is
there only in a run with a view.
"""

from __future__ import annotations

import mmap

import numpy as np
from numpy.typing import NDArray

from companion.config.planning import MethodName
from outrider.scene.changes import Change
from outrider.scene.companion_snapshot import MODES, Glimpse
from outrider.scene.snapshot import KNOTS, Array, State
from outrider.scene.view_commands import Wishes

EVERY = 50_000
"""µs between two looks at a node."""
_PLAN = 6 * KNOTS
_ROW = 8 + _PLAN
"""Attitude (4), mode, age, plan's time, held plans, plan."""
_WISHES = 7
"""How often something was wished; methods as bits; loss; how often the target was moved, and where to (3)."""
_METHODS = Wishes(methods="baseline+swivel+approach_angle+tangential").method_names


class Window:
    """For ``vehicles`` vehicles; made before the processes fork."""

    def __init__(self, vehicles: int) -> None:
        memory = mmap.mmap(-1, 8 * (_WISHES + vehicles * _ROW))
        numbers = np.frombuffer(memory, dtype=np.float64)
        self._wishes: NDArray[np.float64] = numbers[:_WISHES]
        self._rows: NDArray[np.float64] = numbers[_WISHES:].reshape(vehicles, _ROW)
        self._rows[:] = np.nan
        self._wishes[1:3] = np.nan

    def show_attitude(self, k: int, attitude: Array) -> None:
        """Of vehicle ``k``: (4,) w x y z, FRD in NED."""
        self._rows[k, 0:4] = attitude

    def show_companion(self, k: int, seen: Glimpse) -> None:
        """Of companion ``k``."""
        state, row = seen.state, self._rows[k]
        row[4:8] = MODES.index(state.mode), state.age_s, state.plan_ms, state.held or 0
        row[8:] = seen.plan.ravel()

    @property
    def attitudes(self) -> Array:
        """(K, 4), a copy; NaN until a vehicle shows itself."""
        return self._rows[:, 0:4].copy()

    @property
    def plans(self) -> NDArray[np.float32]:
        """(K, KNOTS, 6), a copy."""
        return self._rows[:, 8:].astype(np.float32).reshape(-1, KNOTS, 6)

    @property
    def states(self) -> tuple[State, ...]:
        """K of them."""
        return tuple(
            State()
            if np.isnan(mode)
            else State(MODES[int(mode)], float(age), float(spent), None if np.isnan(held) else int(held))
            for mode, age, spent, held in self._rows[:, 4:8]
        )

    def wish(self, change: Change) -> None:
        """Let the processes know of a change. They see it when they next look."""
        found = self._wishes
        if change.methods is not None:
            asked = Wishes(methods=change.methods).method_names
            found[1] = sum(1 << bit for bit, name in enumerate(_METHODS) if name in asked)
        if change.loss is not None:
            found[2] = change.loss
        if change.target is not None:
            found[4:7] = change.target
            found[3] += 1
        found[0] += 1

    @property
    def wishes(self) -> int:
        """How often something was wished."""
        return int(self._wishes[0])

    @property
    def methods(self) -> tuple[MethodName, ...]:
        """Those that are wished; none: those of the scenario."""
        bits = self._wishes[1]
        if np.isnan(bits):
            return ()
        return tuple(name for bit, name in enumerate(_METHODS) if int(bits) >> bit & 1)

    @property
    def loss(self) -> float | None:
        """The share that is wished to be lost; None: that of the scenario."""
        loss = float(self._wishes[2])
        return None if np.isnan(loss) else loss

    @property
    def moves(self) -> int:
        """How often the target was moved."""
        return int(self._wishes[3])

    @property
    def place(self) -> Array:
        """Where to (3,), a copy."""
        return self._wishes[4:7].copy()
