"""Shared memory of the processes of a real-time run; each process writes its own rows.

Each row of float64 is written by one process. A reader may see a row half old and half new; the two differ by
one sample of a vehicle, which does not matter to an observer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from outrider.processes.shared_memory import SharedMemory
from outrider.realtime.view_page import Window

_COLUMNS = 6
_FLAGS = 3


class SharedPage:
    """Shared memory for ``vehicles`` vehicles; made before the processes fork.

    Times are µs, 0 before the event. ``goal``: the goal event. ``end``: end of the measured flight.
    ``stop``: all processes shall end. ``gone`` (K,): companions that shall end or have ended. ``thaws`` (K,):
    how often each companion was resumed. ``window``: shared memory for a view, None without a view.
    """

    def __init__(self, vehicles: int, window: Window | None = None) -> None:
        self.window = window
        self._memory = SharedMemory(_FLAGS + 4 * vehicles, _COLUMNS * vehicles, vehicles)
        self._flags = self._memory.flags
        self.gone, self._ready, self._armed, self.thaws = self._flags[_FLAGS:].reshape(4, vehicles)
        self._rows = self._memory.numbers.reshape(vehicles, _COLUMNS)
        self._rows[:] = np.nan
        self._armed[:] = 1

    @property
    def goal(self) -> int:
        """Time of the goal event, µs."""
        return int(self._flags[0])

    @goal.setter
    def goal(self, now: int) -> None:
        self._flags[0] = now

    @property
    def end(self) -> int:
        """Time of the end of the measured flight, µs."""
        return int(self._flags[1])

    @end.setter
    def end(self, now: int) -> None:
        self._flags[1] = now

    @property
    def stop(self) -> bool:
        """Whether all processes shall end."""
        return bool(self._flags[2])

    @stop.setter
    def stop(self, value: bool) -> None:
        self._flags[2] = value

    def show_vehicle(
        self, k: int, position: NDArray[np.float64], velocity: NDArray[np.float64], armed: bool
    ) -> None:
        """Write position and velocity (3,) ENU of vehicle ``k``, and whether its motors may turn."""
        self._rows[k, 0:3], self._rows[k, 3:6] = position, velocity
        self._armed[k] = armed

    def show_companion(self, k: int, ready: bool, waiting: str) -> None:
        """Write whether companion ``k`` is in phase ESCORT, and what it waits for."""
        self._ready[k] = ready
        self._memory.write(k, waiting)

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions (K, 3), ENU (m), a copy; NaN until a vehicle has written its own."""
        return self._rows[:, 0:3].copy()

    @property
    def velocities(self) -> NDArray[np.float64]:
        """Velocities (K, 3), ENU (m/s), a copy; NaN as the positions."""
        return self._rows[:, 3:6].copy()

    @property
    def armed(self) -> NDArray[np.bool_]:
        """Whether each vehicle is armed, (K,); True until it has written its state."""
        armed: NDArray[np.bool_] = self._armed != 0
        return armed

    @property
    def ready(self) -> NDArray[np.bool_]:
        """Whether each companion is in phase ESCORT, (K,)."""
        ready: NDArray[np.bool_] = self._ready != 0
        return ready

    def waiting(self, k: int) -> str:
        """Return what companion ``k`` waits for."""
        return self._memory.read(k)
