"""Whose word of where it is may be taken for a moment: who shares a plan, is where that says, and has said
nothing else for a while.

A vehicle of which two things are said, by a receiver that jumps or by somebody who speaks in its name, may
be at either place; and one that shares no plan flies by no limits that are known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.estimation.tracks import Track
from companion.values.horizon import Array, Located

_STEADY = 3_000_000
"""µs for which a track has to have taken all that was said."""
_FRESH = 2_000_000
"""µs that a plan may be older than its sender's last state."""
_BESIDE = 1.0
"""m by which the plan may pass beside it."""


class _Story(NamedTuple):
    track: Track
    refused: int


class TrustedPeers:
    """Those of one companion, row by row as it keeps their last states."""

    def __init__(self) -> None:
        self._stories: list[_Story] = []
        self._since = np.zeros(0, dtype=np.int64)

    def note(self, now: int, row: int, track: Track) -> None:
        """The vehicle of ``row``, which is one of those there are or the next, was heard at ``now`` (µs). To
        be told of every message that its track was given, or one that was refused or doubted is missed."""
        story = _Story(track, track.refused)
        if row == len(self._stories):
            self._stories.append(story)
            self._since = np.append(self._since, now)
            return
        last = self._stories[row]
        if last.track is not track or last.refused != story.refused or track.doubted:
            self._stories[row] = story
            self._since[row] = now

    def trusted(self, now: int, states: Array, plans: Located) -> NDArray[np.bool_]:
        """Which of them are (M,) at ``now`` (µs). ``states`` (M, 6): their last; ``plans``: where each one's
        plan was when that was true."""
        off = plans.positions - states[:, 0:3]
        there = (plans.after >= -plans.dt) & (plans.after <= _FRESH) & (np.vecdot(off, off) <= _BESIDE**2)
        return np.asarray(there & (now - self._since >= _STEADY))
