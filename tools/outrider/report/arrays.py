"""Arrays of a run as the report needs them: values out of range are unknown."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from outrider.errors import InputError
from outrider.report.run import Array, Motions, Plans, PlanTimes
from outrider.runs.array_file import Shapes, read_arrays
from outrider.runs.arrays import motion_shapes

_MAX_TIME_S = 1e5
"""Largest time (s) from the goal event."""
_MAX_MAGNITUDE = 1e9
"""Largest magnitude (m, m/s, rad): more is damage."""

_MOTIONS = motion_shapes("K", "M")
_PLANS = {"system": ("n",), "time_s": ("n",), "gradient": ("n", 3)}
_PLAN_TIMES = {"system": ("n",), "plan_ms": ("n",)}


def motions(path: Path) -> Motions:
    """Read ``flight.npz``. Raises InputError, which names the fault."""
    arrays = _read(path, _MOTIONS)
    time = arrays["time_s"]
    if not len(time):
        raise InputError(f"{path.name}: holds no sample")
    if not (np.abs(time) < _MAX_TIME_S).all():
        raise InputError(f"{path.name}: time_s is not within {_MAX_TIME_S:g} s of the goal event")
    if not (np.diff(time) > 0.0).all():
        raise InputError(f"{path.name}: time_s does not rise")
    system = tuple(arrays["system"].astype(int).tolist())
    # An infinite separation means that no pair is in the air; other values out of range are unknown.
    rest = [
        arrays[name]
        if name == "separation"
        else np.where(np.abs(arrays[name]) < _MAX_MAGNITUDE, arrays[name], np.nan)
        for name in _MOTIONS
        if name not in ("system", "time_s")
    ]
    return Motions(system, time, *rest)


def plans(path: Path) -> Plans:
    """Read ``plans.npz``. Raises InputError."""
    arrays = _read(path, _PLANS)
    gradient = arrays["gradient"]
    size = np.linalg.norm(np.where(np.abs(gradient) < _MAX_MAGNITUDE, gradient, np.nan), axis=1)
    return Plans(arrays["system"].astype(np.int64), arrays["time_s"], size)


def plan_times(path: Path) -> PlanTimes:
    """Read ``plan_times.npz``. Raises InputError."""
    arrays = _read(path, _PLAN_TIMES)
    return PlanTimes(arrays["system"].astype(np.int64), arrays["plan_ms"])


def _read(path: Path, shapes: Shapes) -> dict[str, Array]:
    """Read arrays by name, as float64. Raises InputError, also if a system id is impossible."""
    found = {name: values.astype(np.float64) for name, values in read_arrays(path, shapes).items()}
    if not ((found["system"] >= 0) & (found["system"] <= 255)).all():
        raise InputError(f"{path.name}: system is not a system id everywhere")
    return found
