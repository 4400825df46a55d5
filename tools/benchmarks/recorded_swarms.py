"""File of a flight of several real firmwares: what each vehicle received, estimated and did.

All data are NED, m and s, in one frame with the fleet's origin as zero, so that the vehicles can be compared
with each other. Times count from the start of the recording, on the clock of the recording computer.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Final, Literal, NamedTuple, cast, get_args

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20 import all as mavlink

from outrider.errors import InputError

Array = npt.NDArray[np.float64]

SETPOINT_COLUMNS: Final = 10
MOTION_COLUMNS: Final = 7
FlavourName = Literal["ardupilot", "px4"]
FLAVOURS: Final[dict[int, FlavourName]] = {
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ardupilot",
    mavlink.MAV_AUTOPILOT_PX4: "px4",
}
"""Flavours by MAV_AUTOPILOT."""


class SwarmVehicle(NamedTuple):
    """One vehicle of a recorded swarm. Rows are in the order of their times."""

    system: int
    flavour: FlavourName
    setpoints: Array  # (n, 10) s, m, m/s, m/s²: time of sending, position, velocity, acceleration
    estimate: Array  # (n, 7) s, m, m/s: time, position, velocity reported by the vehicle
    truth: Array  # (n, 7) s, m, m/s: time, position, velocity of its simulation

    def __str__(self) -> str:
        return f"{self.flavour} {self.system}"


def write_swarm(path: Path, vehicles: Iterable[SwarmVehicle]) -> None:
    """Write vehicles as float32 and by columns, which compress better."""
    arrays: dict[str, npt.NDArray[np.generic]] = {}
    for vehicle in vehicles:
        arrays[f"{vehicle.system}_flavour"] = np.array(vehicle.flavour)
        for name, rows in zip(("setpoints", "estimate", "truth"), vehicle[2:], strict=True):
            arrays[f"{vehicle.system}_{name}"] = np.ascontiguousarray(rows.T, dtype=np.float32)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def read_swarm(path: Path) -> list[SwarmVehicle]:
    """Return the vehicles in a file, by their system ids. Raises InputError."""
    try:
        with path.open("rb") as raw, np.load(raw) as file:
            systems = sorted(int(name.partition("_")[0]) for name in file.files if name.endswith("_flavour"))
            vehicles = [
                SwarmVehicle(
                    system,
                    cast("FlavourName", str(file[f"{system}_flavour"])),
                    _rows(file[f"{system}_setpoints"], SETPOINT_COLUMNS),
                    _rows(file[f"{system}_estimate"], MOTION_COLUMNS),
                    _rows(file[f"{system}_truth"], MOTION_COLUMNS),
                )
                for system in systems
            ]
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: is no recorded swarm: {error}") from None
    if not vehicles or any(vehicle.flavour not in get_args(FlavourName) for vehicle in vehicles):
        raise InputError(f"{path}: holds no ArduPilot or PX4")
    return vehicles


def at_times(rows: Array, times: Array) -> Array:
    """Return position and velocity (n, 6) at ``times`` (n,), interpolated in the rows (m, 7) of a motion."""
    return np.column_stack([np.interp(times, rows[:, 0], column) for column in rows[:, 1:].T])


def _rows(columns: npt.NDArray[np.float32], count: int) -> Array:
    if columns.ndim != 2 or columns.shape[0] != count or columns.shape[1] < 2:
        raise ValueError(f"{count} columns expected, found an array of shape {columns.shape}")
    return np.asarray(columns.T, dtype=np.float64)
