"""Ground truth of a flight, from the simulated physics and never from estimates.

It holds the separation at every physics step, and samples at 50 Hz of all that figures and the summary show.
"""

from __future__ import annotations

from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.obstacles.moving import MovingObstacles
from outrider.runs.surfaces import Nearby, Rows, Surfaces

Array = NDArray[np.float64]
SAMPLE = 20_000
"""µs between samples."""
ROW = 17
"""Columns of a vehicle's sample.

Position, velocity, acceleration, reference, error of the autopilot's estimate (each 3), yaw, tilt.
"""
NOWHERE = np.full(3, np.nan)
NOWHERE.flags.writeable = False
_BATCH_DISTANCES = 10_000
"""Approximate number of distances above which the collected samples are processed."""
_CHUNK_DISTANCES = 5_000
"""Number of distances computed at a time: their differences fit the processor's cache."""
_PIECE = 200
"""Number of physics steps for which obstacles near the vehicles are searched together."""


class Samples(NamedTuple):
    """T samples of K vehicles, fleet-local ENU, SI, radians; missing values are NaN.

    ``time`` (T,) µs; ``position``, ``velocity``, ``acceleration``, ``reference``, ``estimate_error``
    (estimated less true position) (T, K, 3); ``yaw``, ``tilt`` (T, K); ``target`` (T, 3); ``separation``
    (T,): least distance between vehicles in the air since the previous sample, infinite without such a pair;
    ``moving`` (T, M, 3): moving obstacles.
    """

    time: NDArray[np.int64]
    position: Array
    velocity: Array
    acceleration: Array
    reference: Array
    estimate_error: Array
    yaw: Array
    tilt: Array
    target: Array
    separation: Array
    moving: Array


class Limits(NamedTuple):
    """Least allowed distances (m): between centres, and from a centre to an obstacle's surface.

    None: that distance is not checked. ``downwash``: number by which differences in height of two vehicles
    are divided.
    """

    vehicles: float
    target: float | None = None
    obstacles: float = 0.0
    downwash: float = 1.0


class Encounters:
    """Counter of encounters: each uninterrupted time of a pair below the distance ``least`` (m) is one."""

    def __init__(self, pairs: int, least: float) -> None:
        self._least = least
        self._below = np.zeros(pairs, dtype=bool)
        self.count = 0
        self.minimum = float("inf")

    def see(self, distances: Array, of: Rows | slice = slice(None)) -> None:
        """Process distances (n, P) of the pairs ``of`` at consecutive times; NaN where one is not in the air.

        All other pairs are further away than the least distance. A pair below it that is no longer in the air
        must be among ``of``.
        """
        least = _least(distances)
        self.minimum = min(self.minimum, least)
        if least < self._least or self._below.any():
            below = np.vstack([self._below[of], distances < self._least])
            # A pair keeps its last state while its distance is unknown.
            unknown = np.isnan(distances)
            for step in np.flatnonzero(unknown.any(axis=1)):
                below[step + 1] |= below[step] & unknown[step]
            self.count += int((below[1:] & ~below[:-1]).sum())
            self._below[:] = False
            self._below[of] = below[-1]


class GroundTruth:
    """Collector of the ground truth of ``vehicles``: positions at every physics step, and periodic samples.

    Distances are computed for many samples at once, when there are enough of them or when they are requested.
    """

    def __init__(
        self,
        vehicles: int,
        limits: Limits,
        obstacles: Surfaces | None = None,
        moving: MovingObstacles | None = None,
    ) -> None:
        self._count = vehicles
        self._pairs = np.triu_indices(vehicles, 1)
        self._fixed = obstacles if obstacles is not None and len(obstacles) else None
        self._vehicles = Encounters(len(self._pairs[0]), limits.vehicles)
        self._downwash = limits.downwash
        self._target = Encounters(vehicles, 0.0 if limits.target is None else limits.target)
        self._moving = moving if moving is not None and len(moving) else None
        self._moves = 0 if self._moving is None else len(self._moving)
        self._nearby = None if self._fixed is None else Nearby(self._fixed, vehicles)
        self._stands = 0 if self._fixed is None else len(self._fixed)
        self._obstacles = Encounters(vehicles * (self._stands + self._moves), limits.obstacles)
        self._least_to_obstacles = limits.obstacles
        self._target_counts = limits.target is not None
        # Data without computed distances yet: the tracks before each sample, those of the target and of
        # moving obstacles.
        self._tracks: list[Array] = []
        self._places: list[Array] = []
        self._moved: list[Array] = []
        self._rows: list[tuple[int, Array, Array, Array]] = []
        self._least: list[float] = []

    @property
    def vehicles(self) -> Encounters:
        """Encounters of vehicles with each other."""
        self._work_out()
        return self._vehicles

    @property
    def target(self) -> Encounters:
        """Encounters of vehicles with the target, where the target is an obstacle."""
        self._work_out()
        return self._target

    @property
    def obstacles(self) -> Encounters:
        """Encounters of vehicles' centres with the surfaces of obstacles, fixed and moving."""
        self._work_out()
        return self._obstacles

    def take(self, now: int, track: Array, rows: Array, target: Array, moving: Array) -> None:
        """Add a sample at ``now`` (µs), and the positions at all physics steps since the previous one.

        ``rows`` (K, ROW) is the sample. Positions are ENU: ``track`` (n, K, 3), NaN on the ground; ``target``
        (n, 3), NaN where it is absent; ``moving`` obstacles (n, M, 3).
        """
        self._rows.append((now, rows, target[-1], moving[-1]))
        self._tracks.append(track)
        self._places.append(target)
        self._moved.append(moving)
        if len(self._tracks) * len(track) * (1 + len(self._pairs[0])) > _BATCH_DISTANCES:
            self._work_out()

    def _work_out(self) -> None:
        if not self._tracks:
            return
        lengths = [len(track) for track in self._tracks]
        track = np.concatenate(self._tracks)
        levelled = track if self._downwash == 1.0 else track / (1.0, 1.0, self._downwash)
        distance = _distances(levelled, *self._pairs)
        self._vehicles.see(distance)
        parts = pairwise(accumulate(lengths, initial=0))
        self._least += [_least(distance[begin:end]) for begin, end in parts]
        if self._target_counts:
            off = track - np.concatenate(self._places)[:, None]
            self._target.see(np.sqrt(np.einsum("tki,tki->tk", off, off)))
        if self._stands or self._moves:
            moved = np.concatenate(self._moved)
            for first in range(0, len(track), _PIECE):
                self._see_obstacles(track[first : first + _PIECE], moved[first : first + _PIECE])
        self._tracks.clear()
        self._places.clear()
        self._moved.clear()

    def _see_obstacles(self, track: Array, moved: Array) -> None:
        """Count encounters on ``track`` (n, K, 3) with fixed obstacles and with those at ``moved`` (n, M, 3).

        Fixed obstacles further than the least distance so far, and than the limit, change nothing.
        """
        surfaces, pairs = [np.empty((len(track), 0))], [np.empty(0, dtype=np.int64)]
        if self._fixed is not None and self._nearby is not None:
            least = self._obstacles.minimum
            if np.isinf(least):
                least = _least(self._fixed.nearest(track))
            if np.isfinite(least):
                near = self._nearby.pairs(track, max(least, self._least_to_obstacles))
                surfaces.append(self._fixed.distance(track[:, near.vehicle], near.obstacle))
                pairs.append(near.vehicle * self._stands + near.obstacle)
        if self._moving is not None:
            surfaces.append(self._moving.distance(track, moved).reshape(len(track), -1))
            first = self._count * self._stands
            pairs.append(np.arange(first, first + self._count * self._moves))
        self._obstacles.see(np.concatenate(surfaces, axis=1), np.concatenate(pairs))

    def latest(self) -> tuple[Array, Array, Array | None]:
        """Return positions and velocities (K, 3) of the last sample, and the target's position or None."""
        _, rows, place, _ = self._rows[-1]
        return rows[:, 0:3], rows[:, 3:6], None if np.isnan(place).any() else place

    @property
    def latest_separation(self) -> float:
        """``Samples.separation`` (m) of the last sample."""
        self._work_out()
        return self._least[-1]

    def samples(self, since: int = 0, until: int | None = None) -> Samples:
        """Return all samples with ``since`` ≤ time < ``until``."""
        self._work_out()
        chosen = [
            (*row, least)
            for row, least in zip(self._rows, self._least, strict=True)
            if row[0] >= since and (until is None or row[0] < until)
        ]
        rows = np.array([row[1] for row in chosen]) if chosen else np.empty((0, self._count, ROW))
        return Samples(
            np.array([row[0] for row in chosen], dtype=np.int64),
            rows[..., 0:3],
            rows[..., 3:6],
            rows[..., 6:9],
            rows[..., 9:12],
            rows[..., 12:15],
            rows[..., 15],
            rows[..., 16],
            np.array([row[2] for row in chosen]).reshape(-1, 3),
            np.array([row[4] for row in chosen]),
            np.array([row[3] for row in chosen]) if chosen else np.empty((0, self._moves, 3)),
        )


def _distances(track: Array, one: NDArray[np.int64], other: NDArray[np.int64]) -> Array:
    """Return the distances (n, pairs), m, of the vehicles ``one`` and ``other`` (pairs,) in ``track``."""
    found = np.empty((len(track), len(one)))
    rows = max(1, _CHUNK_DISTANCES // max(1, len(one)))
    for first in range(0, len(track), rows):
        part = track[first : first + rows]
        apart = part.take(one, axis=1)
        apart -= part.take(other, axis=1)
        np.einsum("tpi,tpi->tp", apart, apart, out=found[first : first + rows])
    return np.sqrt(found, out=found)


def _least(distances: Array) -> float:
    """Return the least of ``distances`` without the missing ones (NaN); infinite if there is none."""
    return float(np.fmin.reduce(distances, axis=None, initial=np.inf))
