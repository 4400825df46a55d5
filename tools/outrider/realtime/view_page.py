"""Shared memory of a real-time run for its view: states of the nodes, and commands to them.

As in ``SharedPage``, one process writes each row, and a reader may see a row half old and half new. The
memory exists only in a run with a view.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.config.planning import MethodName
from outrider.processes.shared_memory import SharedMemory
from outrider.scene.camera_view import COLUMNS
from outrider.scene.changes import Change
from outrider.scene.companion_snapshot import MODES, CompanionSnapshot
from outrider.scene.snapshot import KNOTS, Array, State
from outrider.scene.view_commands import ViewCommands

EVERY = 50_000
"""µs between two snapshots of a node."""
_PLAN_COLUMNS = 6 * KNOTS
_VIEW = slice(8, 8 + COLUMNS)
_ROW_COLUMNS = _VIEW.stop + _PLAN_COLUMNS
"""Columns: attitude (4), mode, age (s), CPU time of the plan (ms), held plans, camera, plan (KNOTS x 6)."""
_COMMAND_COLUMNS = 7
"""Columns: number of commands; methods as bits; loss (0…1); number of moves of the target; last place (3)."""
_METHODS = ViewCommands(methods="baseline+swivel+approach_angle+tangential").method_names


class Window:
    """Shared memory for ``vehicles`` vehicles; made before the processes fork."""

    def __init__(self, vehicles: int) -> None:
        numbers = SharedMemory(0, _COMMAND_COLUMNS + vehicles * _ROW_COLUMNS, 0).numbers
        self._commands: NDArray[np.float64] = numbers[:_COMMAND_COLUMNS]
        self._rows: NDArray[np.float64] = numbers[_COMMAND_COLUMNS:].reshape(vehicles, _ROW_COLUMNS)
        self._rows[:] = np.nan
        self._commands[1:3] = np.nan

    def show_attitude(self, k: int, attitude: Array) -> None:
        """Write the attitude of vehicle ``k``: (4,) w x y z, FRD in NED."""
        self._rows[k, 0:4] = attitude

    def show_companion(self, k: int, seen: CompanionSnapshot) -> None:
        """Write the snapshot of companion ``k``."""
        state, row = seen.state, self._rows[k]
        row[4:8] = MODES.index(state.mode), state.age_s, state.plan_ms, state.held or 0
        row[_VIEW.stop :] = seen.plan.ravel()

    def show_view(self, k: int, view: NDArray[np.float32]) -> None:
        """Write the row of the camera of vehicle ``k``."""
        self._rows[k, _VIEW] = view

    @property
    def attitudes(self) -> Array:
        """Attitudes (K, 4), a copy; NaN until a vehicle has written its own."""
        return self._rows[:, 0:4].copy()

    @property
    def plans(self) -> NDArray[np.float32]:
        """Plans (K, KNOTS, 6), a copy."""
        return self._rows[:, _VIEW.stop :].astype(np.float32).reshape(-1, KNOTS, 6)

    @property
    def views(self) -> NDArray[np.float32]:
        """Rows (K, 12) of the cameras, a copy."""
        return self._rows[:, _VIEW].astype(np.float32)

    @property
    def states(self) -> tuple[State, ...]:
        """States of the K companions."""
        return tuple(
            State()
            if np.isnan(mode)
            else State(MODES[int(mode)], float(age), float(spent), None if np.isnan(held) else int(held))
            for mode, age, spent, held in self._rows[:, 4:8]
        )

    def command(self, change: Change) -> None:
        """Write a change; companions read it at their next snapshot, the target at its next step."""
        found = self._commands
        if change.methods is not None:
            asked = ViewCommands(methods=change.methods).method_names
            found[1] = sum(1 << bit for bit, name in enumerate(_METHODS) if name in asked)
        if change.loss is not None:
            found[2] = change.loss
        if change.target is not None:
            found[4:7] = change.target
            found[3] += 1
        found[0] += 1

    @property
    def commands(self) -> int:
        """Number of commands so far."""
        return int(self._commands[0])

    @property
    def methods(self) -> tuple[MethodName, ...]:
        """Commanded methods; empty: those of the scenario."""
        bits = self._commands[1]
        if np.isnan(bits):
            return ()
        return tuple(name for bit, name in enumerate(_METHODS) if int(bits) >> bit & 1)

    @property
    def loss(self) -> float | None:
        """Commanded share of lost datagrams; None: that of the scenario."""
        loss = float(self._commands[2])
        return None if np.isnan(loss) else loss

    @property
    def moves(self) -> int:
        """Number of moves of the target."""
        return int(self._commands[3])

    @property
    def place(self) -> Array:
        """Place to which the target was moved last (3,), fleet-local ENU, a copy."""
        return self._commands[4:7].copy()
