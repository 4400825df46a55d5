"""What squads show of themselves: a page of memory that each process writes its own rows of, and anybody
reads. A row that is half old does not matter to who watches."""

from __future__ import annotations

import mmap
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

SAYINGS: Final = 8
"""So many of the last texts of a vehicle are kept."""
_TEXT: Final = 256
_FLAGS: Final = 16
"""Bytes: two numbers."""


class Gauges(NamedTuple):
    """One vehicle as it was a moment ago. ``position`` (m) and ``velocity`` (m/s) are true, ENU from the
    request's origin; ``battery`` 0…1; ``received`` and ``sent`` count messages; ``clients`` are those
    connected, or heard within 10 s; ``said`` counts the texts so far; ``time`` (s) since boot."""

    up: bool = False
    armed: bool = False
    custom_mode: int = 0
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    battery: float = 1.0
    received: int = 0
    sent: int = 0
    clients: int = 0
    said: int = 0
    time: float = 0.0


class Pace(NamedTuple):
    """How one process keeps up: simulated and wall time (s) since its loop began, steps, those that came
    late by more than a period, deadlines without a step, and lateness (simulated ms)."""

    simulated: float = 0.0
    wall: float = 0.0
    steps: int = 0
    misses: int = 0
    skipped: int = 0
    late_p99: float = 0.0
    late_max: float = 0.0
    overruns: int = 0


_VEHICLE: Final = 15
_SQUAD: Final = len(Pace._fields)


class Board:
    """For so many vehicles in so many squads; made before the processes fork, which share it then."""

    def __init__(self, vehicles: int, squads: int) -> None:
        numbers = vehicles * _VEHICLE + squads * _SQUAD
        texts = vehicles * SAYINGS + squads
        self._memory = mmap.mmap(-1, _FLAGS + 8 * numbers + texts * _TEXT)
        self._flags: NDArray[np.int64] = np.frombuffer(self._memory, dtype=np.int64, count=2)
        every = np.frombuffer(self._memory, dtype=np.float64, offset=_FLAGS, count=numbers)
        self._vehicles: NDArray[np.float64] = every[: vehicles * _VEHICLE].reshape(vehicles, _VEHICLE)
        self._squads: NDArray[np.float64] = every[vehicles * _VEHICLE :].reshape(squads, _SQUAD)
        self._texts = _FLAGS + 8 * numbers
        self._faults = self._texts + vehicles * SAYINGS * _TEXT

    @property
    def stop(self) -> bool:
        """Whether all shall end."""
        return bool(self._flags[0])

    @stop.setter
    def stop(self, value: bool) -> None:
        self._flags[0] = value

    @property
    def lost(self) -> int:
        """Simulated time (µs) that squads could not keep up with: lost to all of them."""
        return int(self._flags[1])

    @lost.setter
    def lost(self, value: int) -> None:
        self._flags[1] = value

    def show(self, index: int, gauges: Gauges) -> None:
        """Vehicle ``index`` is like this."""
        up, armed, mode, position, velocity, *rest = gauges
        self._vehicles[index] = (up, armed, mode, *position, *velocity, *rest)

    def gauges(self, index: int) -> Gauges:
        """How vehicle ``index`` is; not ``up`` until it has shown itself."""
        up, armed, mode, x, y, z, u, v, w, battery, *counts, time = self._vehicles[index].tolist()
        received, sent, clients, said = map(int, counts)
        return Gauges(
            bool(up),
            bool(armed),
            int(mode),
            (x, y, z),
            (u, v, w),
            battery,
            received,
            sent,
            clients,
            said,
            time,
        )

    def say(self, index: int, number: int, text: str) -> None:
        """The text ``number`` (0…) of vehicle ``index``."""
        self._write(self._texts + (index * SAYINGS + number % SAYINGS) * _TEXT, text)

    def saying(self, index: int, number: int) -> str:
        """One of the last texts of vehicle ``index``."""
        return self._read(self._texts + (index * SAYINGS + number % SAYINGS) * _TEXT)

    def show_pace(self, squad: int, pace: Pace) -> None:
        """Squad ``squad`` keeps up like this."""
        self._squads[squad] = pace

    def paces(self) -> list[Pace]:
        """How each squad keeps up."""
        return [
            Pace(simulated, wall, int(steps), int(misses), int(skipped), p99, most, int(overruns))
            for simulated, wall, steps, misses, skipped, p99, most, overruns in self._squads.tolist()
        ]

    def fail(self, squad: int, text: str) -> None:
        """Why the process of ``squad`` ended."""
        self._write(self._faults + squad * _TEXT, text)

    def fault(self, squad: int) -> str:
        """Empty if there is none."""
        return self._read(self._faults + squad * _TEXT)

    def _write(self, begin: int, text: str) -> None:
        data = text.encode(errors="replace")[: _TEXT - 1]
        self._memory[begin : begin + _TEXT] = data + bytes(_TEXT - len(data))

    def _read(self, begin: int) -> str:
        return self._memory[begin : begin + _TEXT].split(b"\0")[0].decode(errors="replace")
