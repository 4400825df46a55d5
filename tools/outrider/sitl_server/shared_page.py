"""Shared page of memory with the state of the vehicles.

Each worker process writes its own rows, and any process reads them. A reader may find a partly updated row,
which is acceptable for display.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from outrider.processes.shared_memory import SharedMemory

MAX_TEXTS: Final = 8
"""Number of latest texts that are stored per vehicle."""


class VehicleSnapshot(NamedTuple):
    """Snapshot of one vehicle.

    ``up``: whether the vehicle's process has written a snapshot. ``position`` (m) and ``velocity`` (m/s) are
    true, ENU from the request's origin. ``battery`` is 0…1. ``received`` and ``sent`` count messages.
    ``clients``: number of TCP clients that are connected and of UDP clients that sent something within the
    last 10 s. ``said`` counts the texts so far; ``time`` is s since boot.
    """

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
    """Timing of one process.

    ``simulated`` and ``wall``: time (s) since its loop began; ``steps``: number of steps; ``misses``: number
    of steps more than 10 ms late (wall time at speeds above 1, simulated time otherwise); ``skipped``: number
    of deadlines without a step; ``late_p99`` and ``late_max``: lateness of steps (simulated ms);
    ``overruns``: number of datagrams dropped because too many waited.
    """

    simulated: float = 0.0
    wall: float = 0.0
    steps: int = 0
    misses: int = 0
    skipped: int = 0
    late_p99: float = 0.0
    late_max: float = 0.0
    overruns: int = 0


_VEHICLE: Final = 15
_GROUP: Final = len(Pace._fields)


class SharedPage:
    """Shared page for ``vehicles`` vehicles and ``groups`` groups.

    It must be created before the processes are forked.
    """

    def __init__(self, vehicles: int, groups: int) -> None:
        numbers, texts = vehicles * _VEHICLE + groups * _GROUP, vehicles * MAX_TEXTS + groups
        self._memory = memory = SharedMemory(2, numbers, texts)
        self._flags = memory.flags
        self._vehicles = memory.numbers[: vehicles * _VEHICLE].reshape(vehicles, _VEHICLE)
        self._groups = memory.numbers[vehicles * _VEHICLE :].reshape(groups, _GROUP)
        self._faults = vehicles * MAX_TEXTS

    @property
    def stop(self) -> bool:
        """Whether all processes shall end."""
        return bool(self._flags[0])

    @stop.setter
    def stop(self, value: bool) -> None:
        self._flags[0] = value

    @property
    def lost(self) -> int:
        """Simulated time (µs) that was skipped because a process was too slow; all processes skip it."""
        return int(self._flags[1])

    @lost.setter
    def lost(self, value: int) -> None:
        self._flags[1] = value

    def show(self, index: int, snapshot: VehicleSnapshot) -> None:
        """Write the snapshot of vehicle ``index``."""
        up, armed, mode, position, velocity, *rest = snapshot
        self._vehicles[index] = (up, armed, mode, *position, *velocity, *rest)

    def snapshot(self, index: int) -> VehicleSnapshot:
        """Return the snapshot of vehicle ``index``; not ``up`` until its process has written one."""
        up, armed, mode, x, y, z, u, v, w, battery, *counts, time = self._vehicles[index].tolist()
        received, sent, clients, said = map(int, counts)
        return VehicleSnapshot(
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
        """Write the text ``number`` (0…) of vehicle ``index``."""
        self._memory.write(index * MAX_TEXTS + number % MAX_TEXTS, text)

    def saying(self, index: int, number: int) -> str:
        """Return the text ``number`` of vehicle ``index``, one of its latest ``MAX_TEXTS``."""
        return self._memory.read(index * MAX_TEXTS + number % MAX_TEXTS)

    def show_pace(self, group: int, pace: Pace) -> None:
        """Write the timing of group ``group``."""
        self._groups[group] = pace

    def paces(self) -> list[Pace]:
        """Return the timing of each group."""
        return [
            Pace(simulated, wall, int(steps), int(misses), int(skipped), p99, most, int(overruns))
            for simulated, wall, steps, misses, skipped, p99, most, overruns in self._groups.tolist()
        ]

    def fail(self, group: int, text: str) -> None:
        """Write the reason why the process of ``group`` ended."""
        self._memory.write(self._faults + group, text)

    def fault(self, group: int) -> str:
        """Return the reason why the process of ``group`` ended; empty if there is none."""
        return self._memory.read(self._faults + group)
