"""Neighbours whose reported position is trusted for a moment.

A trusted neighbour shares a plan, is where the plan says, and has not contradicted itself for a while. A
vehicle with contradictory reports, caused by a receiver that jumps or by another sender with its id, may be
at either place; and one that shares no plan is not bound by any known limits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.estimation.tracks import Track
from companion.values.horizon import Array, Located

_STEADY = 3_000_000
"""µs for which a track must have accepted all measurements."""
_FRESH = 2_000_000
"""µs by which a plan may be older than its sender's last state."""
_BESIDE = 1.0
"""m by which the plan may pass beside that state."""


class _Record(NamedTuple):
    track: Track
    refused: int


class TrustedPeers:
    """Trust of one companion in its neighbours, in the order of the rows of their last states."""

    def __init__(self) -> None:
        self._records: list[_Record] = []
        self._since = np.zeros(0, dtype=np.int64)

    def note(self, now: int, row: int, track: Track) -> None:
        """Record that a message of the vehicle of ``row`` was received at ``now`` (µs).

        ``row`` is an existing one or the next one. It must be called for every message that was given to the
        track; otherwise a refused or doubted measurement is missed.
        """
        record = _Record(track, track.refused)
        if row == len(self._records):
            self._records.append(record)
            self._since = np.append(self._since, now)
            return
        last = self._records[row]
        if last.track is not track or last.refused != record.refused or track.doubted:
            self._records[row] = record
            self._since[row] = now

    def trusted(self, now: int, states: Array, plans: Located) -> NDArray[np.bool_]:
        """Return which neighbours (M,) are trusted at ``now`` (µs).

        ``states`` (M, 6): their last states; ``plans``: each one's planned position at the time of that
        state.
        """
        off = plans.positions - states[:, 0:3]
        there = (plans.after >= -plans.dt) & (plans.after <= _FRESH) & (np.vecdot(off, off) <= _BESIDE**2)
        return np.asarray(there & (now - self._since >= _STEADY))
