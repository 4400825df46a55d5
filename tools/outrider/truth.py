"""What really happened, from the simulated physics and never from estimates: separation at every physics
step, and samples at 50 Hz of all that figures and the summary show."""

from __future__ import annotations

from math import asin, atan2
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.frames import ned_to_enu, yaw_to_enu
from outrider.targets import Target
from sitl.node import Autopilot

Array = NDArray[np.float64]
SAMPLE = 20_000
"""µs between samples."""


class Samples(NamedTuple):
    """T samples of K vehicles, fleet-local ENU, SI, radians; NaN where there is nothing.

    ``time`` (T,) µs; ``position``, ``velocity``, ``acceleration``, ``reference`` (T, K, 3); ``yaw``, ``tilt``
    (T, K); ``target`` (T, 3); ``separation`` (T,): least distance between vehicles since the sample before.
    """

    time: NDArray[np.int64]
    position: Array
    velocity: Array
    acceleration: Array
    reference: Array
    yaw: Array
    tilt: Array
    target: Array
    separation: Array


class Encounters:
    """Counts how often pairs come below a distance; one stay below it is one encounter."""

    def __init__(self, pairs: int, least: float) -> None:
        self._least = least
        self._below = np.zeros(pairs, dtype=bool)
        self.count = 0
        self.minimum = float("inf")

    def see(self, distances: Array) -> None:
        """Distances (n, pairs) at consecutive times; NaN where a pair is not in the air."""
        if not np.isnan(distances).all():
            self.minimum = min(self.minimum, float(np.nanmin(distances)))
        below = np.vstack([self._below, distances < self._least])
        self.count += int((below[1:] & ~below[:-1]).sum())
        self._below = below[-1]


class Truth:
    """Watches the autopilots of a run; ``see`` is called after every tick."""

    def __init__(
        self, autopilots: list[Autopilot], target: Target, d_min: float, d_min_target: float | None
    ) -> None:
        self._autopilots = autopilots
        self._target = target
        self._pairs = np.triu_indices(len(autopilots), 1)
        self.vehicles = Encounters(len(self._pairs[0]), d_min)
        self.target = Encounters(len(autopilots), 0.0 if d_min_target is None else d_min_target)
        self._target_counts = d_min_target is not None
        self._last = -1
        self._least = float("inf")
        self._next = 0
        self._rows: list[tuple[int, list[Array], Array, float]] = []

    def see(self, now: int) -> bool:
        """Take in the physics steps since the last call; whether a sample was taken at ``now``."""
        times = self._autopilots[0].trace_times
        if not len(times) or times[-1] == self._last:
            return False
        self._last = int(times[-1])
        track = ned_to_enu(np.stack([autopilot.trace for autopilot in self._autopilots], axis=1))
        airborne = np.array([autopilot.airborne for autopilot in self._autopilots])
        track[:, ~airborne] = np.nan
        apart = track[:, self._pairs[0]] - track[:, self._pairs[1]]
        distance = np.sqrt(np.einsum("tpi,tpi->tp", apart, apart))
        self.vehicles.see(distance)
        place = self._target.position(now)
        if place is not None and self._target_counts:
            off = track - place
            self.target.see(np.sqrt(np.einsum("tki,tki->tk", off, off)))
        if distance.size and not np.isnan(distance).all():
            self._least = min(self._least, float(np.nanmin(distance)))
        if now < self._next:
            return False
        self._next = now + SAMPLE
        self._sample(now, place)
        return True

    def latest(self) -> tuple[Array, Array, Array | None]:
        """Positions (K, 3), velocities (K, 3) of the last sample, and the target's place."""
        _, parts, place, _ = self._rows[-1]
        return parts[0], parts[1], None if np.isnan(place).any() else place

    def samples(self, since: int = 0, until: int | None = None) -> Samples:
        """All samples with ``since`` ≤ time < ``until``."""
        rows = [row for row in self._rows if row[0] >= since and (until is None or row[0] < until)]
        position, velocity, acceleration, reference, yaw, tilt = (
            np.array([row[1][i] for row in rows]) for i in range(6)
        )
        return Samples(
            np.array([row[0] for row in rows], dtype=np.int64),
            position,
            velocity,
            acceleration,
            reference,
            yaw,
            tilt,
            np.array([row[2] for row in rows]).reshape(-1, 3),
            np.array([row[3] for row in rows]),
        )

    def _sample(self, now: int, place: Array | None) -> None:
        states = [autopilot.state for autopilot in self._autopilots]
        references = [autopilot.reference for autopilot in self._autopilots]
        nowhere = np.full(3, np.nan)
        parts = [
            ned_to_enu(np.array([s.position for s in states])),
            ned_to_enu(np.array([s.velocity for s in states])),
            ned_to_enu(np.array([s.acceleration for s in states])),
            ned_to_enu(np.array([nowhere if r is None else r.position for r in references])),
            np.array([yaw_to_enu(_yaw(s.attitude)) for s in states]),
            np.array([_tilt(s.attitude) for s in states]),
        ]
        self._rows.append((now, parts, nowhere if place is None else place, self._least))
        self._least = float("inf")


def _yaw(q: Array) -> float:
    """NED yaw of a quaternion w, x, y, z (body FRD → NED)."""
    w, x, y, z = q
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _tilt(q: Array) -> float:
    """Angle between the body's and the world's vertical, rad."""
    _, x, y, _ = q
    return 2.0 * asin(min(1.0, float(np.hypot(x, y))))
