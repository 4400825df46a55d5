"""Properties of a sequence of set-points, and its distance from another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import SetpointLocal

Array = NDArray[np.float64]
TOGETHER = 100_000
"""µs. A longer interval is a gap, not a step."""
_TRIPLES: Final[dict[str, int]] = {
    "position": mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE,
    "velocity": mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE,
    "acceleration": mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE,
}
"""Bits of the type mask that mean *ignored*."""


class Course(NamedTuple):
    """A sequence of n set-points.

    ``times`` (n,) µs; ``positions``, ``velocities``, ``accelerations`` (n, 3) NED, SI, NaN where the mask
    ignores them; positions are also NaN in frames other than LOCAL_NED; ``yaw`` (n,) rad, ``masks`` and
    ``frames`` (n,).
    """

    times: NDArray[np.int64]
    positions: Array
    velocities: Array
    accelerations: Array
    yaw: Array
    masks: NDArray[np.int64]
    frames: NDArray[np.int64]


class Facts(NamedTuple):
    """Properties of a sequence of set-points; None where there is nothing to measure.

    ``finite``: whether all values that are not ignored are finite; ``max_step_m``: largest distance between
    successive positions within 0.1 s; ``gaps``: number of longer intervals.
    """

    setpoints: int
    finite: bool
    max_step_m: float | None
    max_speed_m_s: float | None
    max_acceleration_m_s2: float | None
    gaps: int
    mask_counts: dict[str, int]
    frames: dict[str, int]


def course(told: Sequence[tuple[int, SetpointLocal]]) -> Course:
    """Return set-points with their times as arrays."""
    count = len(told)
    values = np.array(
        [(*m.position, *m.velocity, *m.acceleration, m.yaw) for _, m in told], dtype=np.float64
    ).reshape(count, 10)
    masks = np.array([m.type_mask for _, m in told], dtype=np.int64)
    for k, bits in enumerate(_TRIPLES.values()):
        values[(masks & bits) != 0, 3 * k : 3 * k + 3] = np.nan
    values[(masks & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE) != 0, 9] = np.nan
    frames = np.array([m.frame for _, m in told], dtype=np.int64)
    # Offsets, and axes of the body, are no positions.
    values[frames != mavlink.MAV_FRAME_LOCAL_NED, 0:3] = np.nan
    return Course(
        np.array([time for time, _ in told], dtype=np.int64),
        values[:, 0:3],
        values[:, 3:6],
        values[:, 6:9],
        values[:, 9],
        masks,
        frames,
    )


def facts(told: Sequence[tuple[int, SetpointLocal]]) -> Facts:
    """Return the properties of set-points with their times, in order."""
    of = course(told)
    return Facts(
        len(told),
        all(_finite(m) for _, m in told),
        _largest(steps(of)),
        _largest(np.linalg.norm(of.velocities, axis=1)),
        _largest(np.linalg.norm(of.accelerations, axis=1)),
        int((np.diff(of.times) > TOGETHER).sum()),
        {f"0x{mask:03X}": n for mask, n in sorted(Counter(of.masks.tolist()).items())},
        {str(frame): n for frame, n in sorted(Counter(of.frames.tolist()).items())},
    )


def steps(of: Course) -> Array:
    """Return the distance (n − 1,) m of each position from the previous one; NaN over a gap."""
    far: Array = np.linalg.norm(np.diff(of.positions, axis=0), axis=1)
    far[np.diff(of.times) > TOGETHER] = np.nan
    return far


def apart(would: Course, sent: Course) -> Array:
    """Return the distances (k,) m between the set-points of ``sent`` and ``would``.

    Each set-point of ``sent`` is compared with the newest of ``would`` at its time, if that is at most 0.1 s
    old and both have a position; all others are left out.
    """
    if not len(would.times) or not len(sent.times):
        return np.zeros(0)
    newest = np.searchsorted(would.times, sent.times, side="right") - 1
    fresh = (newest >= 0) & (sent.times - would.times[newest] <= TOGETHER)
    off = np.linalg.norm(sent.positions[fresh] - would.positions[newest[fresh]], axis=1)
    result: Array = off[np.isfinite(off)]
    return result


def _finite(message: SetpointLocal) -> bool:
    """Return whether all values that the mask does not ignore are finite."""
    parts = {"position": message.position, "velocity": message.velocity, "acceleration": message.acceleration}
    used = [v for name, triple in parts.items() if not message.type_mask & _TRIPLES[name] for v in triple]
    if not message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE:
        used.append(message.yaw)
    if not message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE:
        used.append(message.yaw_rate)
    return bool(np.isfinite(used).all())


def _largest(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(known.max()), 4) if len(known) else None
