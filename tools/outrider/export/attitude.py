"""Attitude of vehicles: true yaw and tilt angle, with the lean direction from ATTITUDE messages."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

from outrider.logs.message_stream import LogMessage
from outrider.runs.arrays import Array, Motion

SAID: Final = "ATTITUDE"
_AUTOPILOT_LINK = 0


def leanings(messages: Iterable[LogMessage], owner: int) -> tuple[Array, Array]:
    """Return the lean of a vehicle as reported in the ATTITUDE messages of the owner's autopilot.

    The result is Unix µs (n,), in order of time, and the horizontal part (n, 2), east and north, of the unit
    vector that points up out of the vehicle. Messages with angles that are not finite are skipped.
    """
    times, parts = [], []
    for spoken in messages:
        if spoken.kind.name == SAID and spoken.link == _AUTOPILOT_LINK and spoken.system == owner:
            values = spoken.kind.read(spoken.payload)
            angles = values["roll"], values["pitch"], values["yaw"]
            if all(map(math.isfinite, angles)):
                north, east, _ = along_down(*angles)
                times.append(spoken.time)
                parts.append((-east, -north))
    order = np.argsort(times, kind="stable")
    return np.array(times, dtype=np.float64)[order], np.array(parts, dtype=np.float64).reshape(-1, 2)[order]


def along_down(roll: float, pitch: float, yaw: float) -> tuple[float, float, float]:
    """Return the down axis of a body (FRD) in NED, rotated by yaw, pitch and roll (rad) in this order."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp


def up_vectors(motion: Motion, vehicle: int, said: tuple[Array, Array] | None) -> Array:
    """Return the unit vectors (T, 3), ENU, that point up out of a vehicle at each sample.

    The angle from the vertical is the true tilt; the direction of the lean is interpolated from ``said``. The
    vector is vertical where no lean direction or no tilt is available.
    """
    count = len(motion.time)
    up = np.zeros((count, 3))
    up[:, 2] = 1.0
    if said is None or not len(said[0]):
        return up
    side = np.stack([np.interp(motion.time, said[0], said[1][:, axis]) for axis in (0, 1)], axis=1)
    length = np.hypot(side[:, 0], side[:, 1])
    tilt = motion.tilt[:, vehicle].astype(np.float64)
    leans = (length > 0.0) & np.isfinite(tilt)
    up[leans, :2] = side[leans] * (np.sin(tilt[leans]) / length[leans])[:, None]
    up[leans, 2] = np.cos(tilt[leans])
    return up


def quaternions(yaw: Array, up: Array) -> Array:
    """Return the quaternions (T, 4), w x y z, of bodies (x forward, y left, z up) in ENU.

    The z axis is ``up`` (T, 3), and the nose points to ``yaw`` (T,), rad counter-clockwise from east, seen
    from above. For a vehicle on its side no such nose exists; its forward axis is then as close to ``yaw`` as
    possible.
    """
    ahead = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
    # Projected vertically onto the plane of the rotors, so that the bearing is preserved.
    steep = np.abs(up[:, 2]) > 1e-3
    ahead[steep, 2] = -(ahead[steep] * up[steep]).sum(axis=1) / up[steep, 2]
    ahead[~steep] -= (ahead[~steep] * up[~steep]).sum(axis=1)[:, None] * up[~steep]
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    matrix = np.stack([ahead, np.cross(up, ahead), up], axis=2)
    return _from_matrices(matrix)


def _from_matrices(m: Array) -> Array:
    """Convert rotation matrices (T, 3, 3) to quaternions (T, 4), w ≥ 0, each by its largest component."""
    trace = np.trace(m, axis1=1, axis2=2)
    # 4 q qᵀ: each column is the quaternion times a factor.
    outer = np.empty((len(m), 4, 4))
    outer[:, 0, 0] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        outer[:, i + 1, i + 1] = 1.0 + 2.0 * m[:, i, i] - trace
        outer[:, 0, i + 1] = outer[:, i + 1, 0] = m[:, k, j] - m[:, j, k]
        outer[:, i + 1, j + 1] = outer[:, j + 1, i + 1] = m[:, i, j] + m[:, j, i]
    best = np.argmax(np.diagonal(outer, axis1=1, axis2=2), axis=1)
    result: Array = outer[np.arange(len(m)), best]
    result /= np.linalg.norm(result, axis=1)[:, None]
    return np.where(result[:, :1] < 0.0, -result, result)
