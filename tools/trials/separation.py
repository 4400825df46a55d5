"""Least distances between the vehicles and to the target, also between their messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_STEP = 0.005
"""Time between two samples (s); at 5 m/s that is 2.5 cm, and millimetres of distance at the nearest point."""
GAP = 1.0
"""Longest interval between messages over which a position is interpolated (s)."""
STOOD_STILL = "and the machine may have stood still"
"""End of the fault of a trial that proves nothing, because positions are missing."""


class Nearest(NamedTuple):
    """Least distance (m) of ``pair``, and its time (s)."""

    pair: tuple[int, int]
    distance: float
    at: float


class Track(NamedTuple):
    """Track of a vehicle: times (n,) s, positions (n, 3) m, whether its motors ran (n,)."""

    times: Array
    places: Array
    armed: NDArray[np.bool_]

    def at(self, times: Array) -> Array:
        """Return positions (m, 3) at ``times`` (m,); NaN while its motors are off, and where unknown."""
        found = np.stack([np.interp(times, self.times, self.places[:, k]) for k in range(3)], axis=1)
        after = np.clip(np.searchsorted(self.times, times), 1, len(self.times) - 1)
        unknown = self.times[after] - self.times[after - 1] > GAP
        grounded = ~(self.armed[after] | self.armed[after - 1])
        outside = (times < self.times[0]) | (times > self.times[-1])
        found[unknown | grounded | outside] = np.nan
        return found

    def beside(self, other: Track) -> Array:
        """Return the distances (n,) m to the points of another track of this vehicle; NaN where unknown."""
        off: Array = np.linalg.norm(self.at(other.times) - other.places, axis=1)
        return off

    def moved(self, since: float) -> float:
        """Return the largest distance (m) from the place at ``since`` (s), from then on."""
        places = self.places[self.times >= since]
        return float(np.linalg.norm(places - places[0], axis=1).max()) if len(places) else 0.0


def nearest(
    tracks: Mapping[int, Track], target: tuple[int, Callable[[Array], Array]] | None = None
) -> list[Nearest]:
    """Return the least distance of each pair of ``tracks``, and of each with the ``target``.

    ``target`` is its id, and a function that gives its positions (m, 3) at times (m,); None: there is none.
    Pairs that were never known to fly at once are left out.
    """
    begin = min(track.times[0] for track in tracks.values())
    end = max(track.times[-1] for track in tracks.values())
    times = np.arange(begin, end, _STEP)
    places = {system: track.at(times) for system, track in tracks.items()}
    if target is not None:
        places[target[0]] = target[1](times)
    found = []
    for pair in combinations(places, 2):
        off = np.linalg.norm(places[pair[0]] - places[pair[1]], axis=1)
        if not np.isnan(off).all():
            k = int(np.nanargmin(off))
            found.append(Nearest((pair[0], pair[1]), float(off[k]), float(times[k])))
    return found


def save(tracks: Mapping[int, Track], directory: Path) -> None:
    """Write the tracks to ``tracks.npz`` in ``directory``."""
    ways = {
        f"{name}_{system}": values
        for system, track in tracks.items()
        for name, values in track._asdict().items()
    }
    np.savez_compressed(directory / "tracks.npz", allow_pickle=False, **ways)


def blind(gap: float) -> list[str]:
    """Return a fault if the longest gap (s) is too long: distances during it are unknown."""
    if gap <= GAP:
        return []
    return [f"nothing is known of a flying vehicle for {gap:.1f} s, {STOOD_STILL}"]


def longest_gap(track: Track) -> float:
    """Return the longest time (s) between two messages while the motors ran."""
    flown = track.times[track.armed]
    return float(np.diff(flown).max()) if len(flown) > 1 else 0.0
