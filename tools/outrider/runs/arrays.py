"""Reader of the npz files of a run directory."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.errors import Fault, InputError
from outrider.logs.message_stream import LATEST
from outrider.runs.array_file import Shapes, read_arrays

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Whole = NDArray[np.int64]


class Motion(NamedTuple):
    """True motion: T samples of K vehicles and M moving obstacles, fleet-local ENU, SI, radians.

    Missing values are NaN; ``separation`` is infinite if no two vehicles were in the air. ``start_us``: Unix
    µs of the goal event; ``time`` (T,) Unix µs, ``time_s`` (T,) s after the goal event; ``system`` (K,);
    ``position``, ``velocity``, ``reference`` (T, K, 3); ``yaw``, ``tilt`` (T, K); ``target`` (T, 3);
    ``separation`` (T,); ``moving`` (T, M, 3): see ``flight_file.write_flight``.
    """

    start_us: int
    time: Whole
    time_s: Array
    system: Whole
    position: Single
    velocity: Single
    reference: Single
    yaw: Single
    tilt: Single
    target: Single
    separation: Single
    moving: Single


class Plans(NamedTuple):
    """One value for each of n plans.

    ``time`` (n,) Unix µs and ``time_s`` (n,) s after the goal event, on the companion's clock; ``system``
    (n,), the vehicle of each plan; ``value``: ∇J divided by Ω_t (n, 3), fleet-local ENU, m (see
    ``flight_file.write_plans``), or the CPU time (n,) of the plan in ms.
    """

    time: Whole
    time_s: Array
    system: Whole
    value: Array


def motion_shapes(vehicles: int | str, moving: int | str) -> Shapes:
    """Return the shapes of the arrays of ``flight.npz``: K and M as numbers, or as letters if unknown."""
    return {
        "system": (vehicles,),
        "time_s": ("T",),
        "position": ("T", vehicles, 3),
        "velocity": ("T", vehicles, 3),
        "reference": ("T", vehicles, 3),
        "yaw": ("T", vehicles),
        "tilt": ("T", vehicles),
        "target": ("T", 3),
        "separation": ("T",),
        "moving": ("T", moving, 3),
    }


def read_motion(path: Path, vehicles: int, moving: int) -> Motion | None:
    """Read ``flight.npz`` with the given number of vehicles and moving obstacles.

    Returns None if there is no such file. Raises InputError for a file that does not match ``write_flight``.
    """
    if not path.is_file():
        return None
    arrays = read_arrays(path, {"start_us": (), **motion_shapes(vehicles, moving)})
    start, seconds = int(arrays["start_us"]), arrays["time_s"].astype(np.float64)
    rest = {name: arrays[name].astype(np.float32) for name in Motion._fields[4:]}
    return Motion(start, _unix(path, start, seconds), seconds, arrays["system"].astype(np.int64), **rest)


def read_plans(path: Path, value: str, width: int | None, start_us: int) -> Plans | None:
    """Read the array ``value`` (n, width), or (n,), of ``plans.npz`` or ``plan_times.npz``.

    Returns None if there is no such file. Raises InputError for a file that does not match its writer.
    """
    if not path.is_file():
        return None
    shape = ("n",) if width is None else ("n", width)
    arrays = read_arrays(path, {"system": ("n",), "time_s": ("n",), value: shape})
    seconds = arrays["time_s"].astype(np.float64)
    return Plans(
        _unix(path, start_us, seconds),
        seconds,
        arrays["system"].astype(np.int64),
        arrays[value].astype(np.float64),
    )


def _unix(path: Path, start_us: int, seconds: Array) -> Whole:
    """Return times (n,) in s after ``start_us`` as Unix µs; raise InputError for an invalid time."""
    with np.errstate(invalid="ignore", over="ignore"):
        later = seconds * 1e6 + start_us
    if not ((later >= 0.0) & (later <= LATEST)).all():
        raise InputError(Fault(str(path), "array time_s holds an invalid time"))
    return start_us + np.rint(seconds * 1e6).astype(np.int64)
