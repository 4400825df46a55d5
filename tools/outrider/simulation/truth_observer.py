"""Observers that pass the true state of emulated autopilots to the ground truth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from mavlink_bridge.frames import ned_to_enu, yaw_to_enu
from outrider.runs.ground_truth import NOWHERE, ROW, SAMPLE, Array, GroundTruth
from outrider.simulation.moving import MovingObstacle
from outrider.simulation.moving import places as moving_places
from outrider.simulation.targets import Placed, Target
from sitl.node import Autopilot


class Motions(NamedTuple):
    """Motions of vehicles since the sample before, ENU.

    ``times`` (n,): µs of the physics steps; ``track`` (n, K, 3): positions then, m, NaN while not in the air;
    ``rows`` (K, ROW): samples at the end.
    """

    times: list[int]
    track: Array
    rows: Array


class MotionObserver:
    """Observer of the autopilots of a lock-step run; ``see`` is called after every tick."""

    def __init__(self, autopilots: Sequence[Autopilot]) -> None:
        self._autopilots = autopilots
        self._last = -1
        self._next = 0
        self._pending: list[Array] = []
        self._times: list[int] = []

    def see(self, now: int) -> Motions | None:
        """Process the physics steps since the last call; return a sample if one is due at ``now`` (µs)."""
        moved_to = self._autopilots[0].moved_to
        if moved_to == self._last:
            return None
        times = self._autopilots[0].trace_times
        if not len(times):
            return None
        self._last = moved_to
        traces = np.concatenate([autopilot.trace for autopilot in self._autopilots])
        tracks = traces.reshape(len(self._autopilots), -1, 3)
        standing = [k for k, autopilot in enumerate(self._autopilots) if not autopilot.airborne]
        if standing:
            tracks[standing] = np.nan
        self._pending.append(tracks)
        self._times += times.tolist()
        if now < self._next:
            return None
        self._next = now + SAMPLE
        track = ned_to_enu(np.concatenate(self._pending, axis=1).swapaxes(0, 1))
        motions = Motions(self._times, track, rows(self._autopilots))
        self._pending.clear()
        self._times = []
        return motions


class TruthObserver:
    """Observer that passes motions, and those of target and moving obstacles, to the ground ``truth``."""

    def __init__(self, target: Target, truth: GroundTruth, moving: Sequence[MovingObstacle] = ()) -> None:
        self._target = target
        self._moving = moving
        self._truth = truth

    def take(self, now: int, parts: Sequence[Motions]) -> None:
        """Pass the motions of all vehicles at ``now`` (µs), in ``parts`` in the order of the vehicles."""
        times = parts[0].times
        track = np.concatenate([part.track for part in parts], axis=1)
        samples = np.concatenate([part.rows for part in parts])
        moving = moving_places(self._moving, times)
        self._truth.take(now, track, samples, places(self._target, times), moving)


def places(target: Placed, times: Iterable[int]) -> Array:
    """Return the target's positions (n, 3) at ``times`` (µs, not decreasing), ENU; NaN where it is absent."""
    found = [target.position(time) for time in times]
    return np.array([NOWHERE if place is None else place for place in found])


def rows(autopilots: Sequence[Autopilot]) -> Array:
    """Return the samples (K, ROW) of the vehicles, ENU; columns: see ``ground_truth.ROW``."""
    vectors: list[Array] = []
    attitudes: list[Array] = []
    for autopilot in autopilots:
        state, reference = autopilot.state, autopilot.reference
        place = NOWHERE if reference is None else reference.position
        vectors += (state.position, state.velocity, state.acceleration, place, autopilot.estimate_error)
        attitudes.append(state.attitude)
    result = np.empty((len(autopilots), ROW))
    result[:, :15] = ned_to_enu(np.concatenate(vectors).reshape(-1, 3)).reshape(-1, 15)
    w, x, y, z = np.concatenate(attitudes).reshape(-1, 4).T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    result[:, 15] = [yaw_to_enu(angle) for angle in yaw.tolist()]
    # Tilt: the angle between the vertical axes of body and world.
    result[:, 16] = 2.0 * np.arcsin(np.minimum(1.0, np.hypot(x, y)))
    return result
