"""Reader of a run's ``.npz`` files with checks: damage is reported, missing values are not guessed."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from outrider.errors import InputError
from outrider.report.run import Array, Motions, Plans, PlanTimes

MOST_BYTES = 1 << 30
"""Largest total size of a file's arrays: an hour of a hundred vehicles at 50 Hz has half of it."""
_LONGEST = 1e5
"""Largest time (s) from the goal event."""
_FAR = 1e9
"""Largest magnitude (m, m/s, rad): more is damage."""

_MOTIONS = {
    "system": ("K",),
    "time_s": ("T",),
    "position": ("T", "K", 3),
    "velocity": ("T", "K", 3),
    "reference": ("T", "K", 3),
    "yaw": ("T", "K"),
    "tilt": ("T", "K"),
    "target": ("T", 3),
    "separation": ("T",),
    "moving": ("T", "M", 3),
}
_PLANS = {"system": ("n",), "time_s": ("n",), "gradient": ("n", 3)}
_PLAN_TIMES = {"system": ("n",), "plan_ms": ("n",)}

_DAMAGE = (
    OSError,
    ValueError,
    TypeError,
    KeyError,
    EOFError,
    MemoryError,
    OverflowError,
    RuntimeError,  # from zipfile: encrypted, or compressed with an unknown method
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions that reading a damaged archive of arrays may raise."""

Shapes = Mapping[str, Sequence[int | str]]


def motions(path: Path) -> Motions:
    """Read ``flight.npz``. Raises InputError, which names the fault."""
    arrays = _read(path, _MOTIONS)
    time = arrays["time_s"]
    if not len(time):
        raise InputError(f"{path.name}: holds no sample")
    if not (np.abs(time) < _LONGEST).all():
        raise InputError(f"{path.name}: time_s is not within {_LONGEST:g} s of the goal event")
    if not (np.diff(time) > 0.0).all():
        raise InputError(f"{path.name}: time_s does not rise")
    system = tuple(arrays["system"].astype(int).tolist())
    # An infinite separation means that no pair is in the air; other values out of range are unknown.
    rest = [
        arrays[name] if name == "separation" else np.where(np.abs(arrays[name]) < _FAR, arrays[name], np.nan)
        for name in _MOTIONS
        if name not in ("system", "time_s")
    ]
    return Motions(system, time, *rest)


def plans(path: Path) -> Plans:
    """Read ``plans.npz``. Raises InputError."""
    arrays = _read(path, _PLANS)
    gradient = arrays["gradient"]
    size = np.linalg.norm(np.where(np.abs(gradient) < _FAR, gradient, np.nan), axis=1)
    return Plans(arrays["system"].astype(np.int64), arrays["time_s"], size)


def plan_times(path: Path) -> PlanTimes:
    """Read ``plan_times.npz``. Raises InputError."""
    arrays = _read(path, _PLAN_TIMES)
    return PlanTimes(arrays["system"].astype(np.int64), arrays["plan_ms"])


def _read(path: Path, shapes: Shapes) -> dict[str, Array]:
    """Read arrays by name, as float64, with consistent shapes. Raises InputError."""
    found: dict[str, Array] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MOST_BYTES:
            raise InputError(f"{path.name}: unpacks to {size} bytes; at most {MOST_BYTES} are read")
        with np.load(path, allow_pickle=False) as file:
            for name in shapes:
                if name in file:
                    found[name] = np.asarray(file[name], dtype=np.float64)
    except _DAMAGE as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{path.name}: cannot be read: {reason or type(error).__name__}") from None
    _check(path.name, found, shapes)
    return found


def _check(name: str, found: Mapping[str, Array], shapes: Shapes) -> None:
    sizes: dict[str, int] = {}
    for key, shape in shapes.items():
        if key not in found:
            raise InputError(f"{name}: holds no {key}")
        has = found[key].shape
        fits = len(has) == len(shape) and all(
            size == (sizes.setdefault(axis, size) if isinstance(axis, str) else axis)
            for size, axis in zip(has, shape, strict=True)
        )
        if not fits:
            wanted = ", ".join(str(sizes.get(str(axis), axis)) for axis in shape)
            raise InputError(f"{name}: {key} is of shape {has}; needed: ({wanted})")
    if not ((found["system"] >= 0) & (found["system"] <= 255)).all():
        raise InputError(f"{name}: system is not a system id everywhere")
