"""Tables of a flight: true motion, separation and plans.

The names of columns have the units. Coordinates are fleet-local ENU. A missing value is NaN here and null in
the file.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from outrider.export.table_files import Column, Part
from outrider.runs.arrays import Motion, Plans, Whole
from outrider.runs.source import Run

_ROWS: Final = 65_536
"""Maximum number of rows of one part of ``vehicles`` and ``moving``; each other table is one part."""
_AXES = ("east", "north", "up")


def parts(run: Run) -> Iterator[Part]:
    """Yield the parts of all tables of a flight.

    The tables are ``vehicles``, ``separation`` (with the target), ``moving``, ``plans`` and ``plan_times``.
    In every table ``time_s`` counts from the goal event, and ``utc`` is a time stamp.
    """
    motion = run.motion
    if motion is None:
        return
    yield from _vehicles(motion)
    yield Part(
        "separation",
        {
            **_when(motion.time_s, motion.time),
            "separation_m": np.where(np.isfinite(motion.separation), motion.separation, np.float32(np.nan)),
            **_vector("target", "m", motion.target),
        },
    )
    if run.scenario is not None and run.scenario.moving:
        yield from _moving(motion, np.array(run.scenario.moving_systems))
    if run.gradients is not None:
        yield _plans("plans", run.gradients, _vector("gradient", "m", run.gradients.value))
    if run.plan_times is not None:
        yield _plans("plan_times", run.plan_times, {"plan_ms": run.plan_times.value})


def _vehicles(motion: Motion) -> Iterator[Part]:
    """Yield one row for each vehicle at each sample."""
    count = len(motion.system)
    for some in _slices(len(motion.time), count):
        length = len(motion.time[some])
        yield Part(
            "vehicles",
            {
                **_when(np.repeat(motion.time_s[some], count), np.repeat(motion.time[some], count)),
                "system": np.tile(motion.system, length),
                **_vector("", "m", motion.position[some]),
                **_vector("velocity", "m_s", motion.velocity[some]),
                **_vector("reference", "m", motion.reference[some]),
                "yaw_rad": motion.yaw[some].reshape(-1),
                "tilt_rad": motion.tilt[some].reshape(-1),
            },
        )


def _moving(motion: Motion, systems: Whole) -> Iterator[Part]:
    count = len(systems)
    for some in _slices(len(motion.time), count):
        yield Part(
            "moving",
            {
                **_when(np.repeat(motion.time_s[some], count), np.repeat(motion.time[some], count)),
                "system": np.tile(systems, len(motion.time[some])),
                **_vector("", "m", motion.moving[some]),
            },
        )


def _slices(samples: int, count: int) -> Iterator[slice]:
    step = max(_ROWS // max(count, 1), 1)
    return (slice(at, at + step) for at in range(0, samples, step))


def _plans(name: str, plans: Plans, values: dict[str, Column]) -> Part:
    return Part(name, {**_when(plans.time_s, plans.time), "system": plans.system, **values})


def _when(seconds: NDArray[np.float64], unix: Whole) -> dict[str, Column]:
    return {"time_s": seconds, "utc": unix.astype("datetime64[us]")}


def _vector(name: str, unit: str, values: NDArray[np.floating]) -> dict[str, Column]:
    """Return the columns ``name_east_unit``, ``name_north_unit``, ``name_up_unit`` of vectors (…, 3)."""
    flat = values.reshape(-1, 3)
    prefix = f"{name}_" if name else ""
    return {f"{prefix}{axis}_{unit}": np.ascontiguousarray(flat[:, k]) for k, axis in enumerate(_AXES)}
