"""Reader of the npz files of a run directory."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from outrider.errors import Fault, InputError
from outrider.logs.message_stream import LATEST

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Whole = NDArray[np.int64]
_Arrays = dict[str, NDArray[np.generic]]


class Motion(NamedTuple):
    """True motion: T samples of K vehicles and M moving obstacles, fleet-local ENU, SI, radians.

    Missing values are NaN. ``start_us``: Unix µs of the goal event; ``time`` (T,) Unix µs, ``time_s`` (T,) s
    after the goal event; ``system`` (K,); ``position``, ``velocity``, ``reference`` (T, K, 3); ``yaw``,
    ``tilt`` (T, K); ``target`` (T, 3); ``separation`` (T,); ``moving`` (T, M, 3): see
    ``flight_file.write_flight``.
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
    (n,), the vehicle of each plan; ``value``: ∇J (n, 3), fleet-local ENU, m, or the CPU time (n,) of the plan
    in ms.
    """

    time: Whole
    time_s: Array
    system: Whole
    value: Array


def read_motion(path: Path, vehicles: int, moving: int) -> Motion | None:
    """Read ``flight.npz`` with the given number of vehicles and moving obstacles.

    Returns None if there is no such file. Raises InputError for a file that does not match ``write_flight``.
    """
    arrays = _arrays(path)
    if arrays is None:
        return None
    count = _rows(arrays, "time_s")
    each, vectors = (count, vehicles), (count, vehicles, 3)
    shapes: dict[str, tuple[int, ...]] = {
        "start_us": (),
        "system": (vehicles,),
        "time_s": (count,),
        "position": vectors,
        "velocity": vectors,
        "reference": vectors,
        "yaw": each,
        "tilt": each,
        "target": (count, 3),
        "separation": (count,),
        "moving": (count, moving, 3),
    }
    _check(path, arrays, shapes)
    start, seconds = int(arrays["start_us"]), arrays["time_s"].astype(np.float64)
    rest = {name: arrays[name].astype(np.float32) for name in Motion._fields[4:]}
    return Motion(start, _unix(path, start, seconds), seconds, arrays["system"].astype(np.int64), **rest)


def read_plans(path: Path, value: str, width: int | None, start_us: int) -> Plans | None:
    """Read the array ``value`` (n, width), or (n,), of ``plans.npz`` or ``plan_times.npz``.

    Returns None if there is no such file. Raises InputError for a file that does not match its writer.
    """
    arrays = _arrays(path)
    if arrays is None:
        return None
    count = _rows(arrays, "system")
    shape = (count,) if width is None else (count, width)
    _check(path, arrays, {"system": (count,), "time_s": (count,), value: shape})
    seconds = arrays["time_s"].astype(np.float64)
    return Plans(
        _unix(path, start_us, seconds),
        seconds,
        arrays["system"].astype(np.int64),
        arrays[value].astype(np.float64),
    )


def _arrays(path: Path) -> _Arrays | None:
    if not path.is_file():
        return None
    try:
        with path.open("rb") as raw, np.load(raw) as file:
            return {name: file[name] for name in file.files}
    except (ValueError, OSError, EOFError, BadZipFile, zlib.error, NotImplementedError) as error:
        raise InputError(Fault(str(path), f"cannot be read: {error}; allowed: what outrider left")) from None


def _rows(arrays: _Arrays, name: str) -> int:
    found = arrays.get(name)
    return len(found) if found is not None and found.ndim else 0


def _check(path: Path, arrays: _Arrays, shapes: dict[str, tuple[int, ...]]) -> None:
    """Raise InputError for an array that is missing, has another shape, or holds no numbers."""
    for name, shape in shapes.items():
        found = arrays.get(name)
        if found is None:
            wrong = f"has no array {name}; allowed: what this version of outrider leaves"
            raise InputError(Fault(str(path), wrong))
        if found.shape != shape or found.dtype.kind not in "if":
            wrong = f"array {name} is {found.dtype} {found.shape}; allowed: numbers {shape}"
            raise InputError(Fault(str(path), wrong))


def _unix(path: Path, start_us: int, seconds: Array) -> Whole:
    """Return times (n,) in s after ``start_us`` as Unix µs; raise InputError for an invalid time."""
    with np.errstate(invalid="ignore", over="ignore"):
        later = seconds * 1e6 + start_us
    if not ((later >= 0.0) & (later <= LATEST)).all():
        raise InputError(Fault(str(path), "array time_s holds what is no time"))
    return start_us + np.rint(seconds * 1e6).astype(np.int64)
