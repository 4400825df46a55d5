"""Trusted neighbours: the relevance filter may ignore their messages for a short time.

A trusted neighbour shares a plan, is at most 1 m from it, and its track has accepted all measurements for 3
s. A vehicle with contradictory reports, caused by a position that jumps or by another sender with its id, may
be at either position; and a vehicle that shares no plan is not bound by any known limits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.values.horizon import Array, Located

_CONSISTENT_US = 3_000_000
"""µs for which a track must have accepted all measurements of a trusted neighbour."""
_MAX_PLAN_AGE_US = 2_000_000
"""µs by which a plan may be older than its sender's last state."""
_MAX_PLAN_OFFSET = 1.0
"""m between the plan and that state, at most."""


class TrustedPeers:
    """Trust of one companion in its neighbours, in the order of the rows of their last states."""

    def __init__(self) -> None:
        self._since = np.zeros(0, dtype=np.int64)

    def add(self, now: int) -> None:
        """Add a row for a vehicle whose first measurement was accepted at ``now`` (µs)."""
        self._since = np.append(self._since, now)

    def restart(self, now: int, row: int) -> None:
        """Begin the time of trust in the vehicle of ``row`` again at ``now`` (µs).

        The reason is a new track, or a measurement that was refused or leaves the track in doubt.
        """
        self._since[row] = now

    def consistent(self, now: int) -> NDArray[np.bool_]:
        """Return the neighbours (M,) whose tracks have accepted all measurements long enough at ``now`` (µs).

        Those that also follow their plans (``follows``) are trusted.
        """
        return np.asarray(now - self._since >= _CONSISTENT_US)


def follows(states: Array, plans: Located) -> NDArray[np.bool_]:
    """Return which neighbours (M,) are near their plans.

    ``states`` (M, 6): their last states; ``plans``: the position that each neighbour had planned for the time
    of its last state.
    """
    off = plans.positions - states[:, 0:3]
    return np.asarray(
        (plans.after >= -plans.dt)
        & (plans.after <= _MAX_PLAN_AGE_US)
        & (np.vecdot(off, off) <= _MAX_PLAN_OFFSET**2)
    )
