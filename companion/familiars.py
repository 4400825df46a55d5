"""Whose word of where it is may be taken for a moment: who shares a plan, is where that says, and has said
nothing else for a while.

A vehicle of which two things are said, by a receiver that jumps or by somebody who speaks in its name, may
be at either place; and one that shares no plan flies by no limits that are known.
"""

from __future__ import annotations

from typing import NamedTuple

from companion.horizon import Horizon
from companion.tracks import Track

_STEADY = 3_000_000
"""µs for which a track has to have taken all that was said."""
_FRESH = 2_000_000
"""µs that a plan may be older than its sender's last state."""
_BESIDE = 1.0
"""m by which the plan may pass beside it."""


class _Steady(NamedTuple):
    track: Track
    refused: int
    since: int


class Familiars:
    """Those of one companion, by system id."""

    def __init__(self) -> None:
        self._steady: dict[int, _Steady] = {}

    def trusts(self, now: int, system: int, track: Track, plan: Horizon) -> bool:
        """Whether ``system``, of this ``track`` and latest ``plan``, is one of them at ``now`` (µs); to be
        asked several times a second as long as that matters."""
        last = self._steady.get(system)
        if last is None or last.track is not track or last.refused != track.refused or track.doubted:
            self._steady[system] = _Steady(track, track.refused, now)
            return False
        return now - last.since >= _STEADY and _agree(track, plan)


def _agree(track: Track, plan: Horizon) -> bool:
    """Whether the last state lies on the plan."""
    time = track.time
    if time is None or not -plan.dt <= time - plan.epoch <= _FRESH:
        return False
    off = plan.at(time).position - track.last[0:3]
    return bool(off @ off <= _BESIDE**2)
