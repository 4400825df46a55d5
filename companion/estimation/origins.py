"""Selection of the valid GPS_GLOBAL_ORIGIN when messages overtake each other."""

from __future__ import annotations

from mavlink_bridge.messages import GpsGlobalOrigin

_MAX_OVERTAKING_US = 2_000_000
"""Longest time by which messages overtake each other.

An autopilot that reboots, and thereby restarts its clock, takes longer than this to find a position.
"""


class Origins:
    """Origin messages of one autopilot; the last one for which ``counts`` is true is its origin."""

    def __init__(self) -> None:
        self._time = self._received = 0

    def counts(self, now: int, origin: GpsGlobalOrigin) -> bool:
        """Return whether ``origin``, received at ``now`` (µs), is to be used.

        It is not to be used if its time stamp is earlier than that of the last used origin, and the last used
        origin was received at most 2 s before: it is then late or resent, and no later message would restore
        the newer origin. An origin without a time stamp (0) is always used.
        """
        if 0 < origin.time < self._time and now - self._received <= _MAX_OVERTAKING_US:
            return False
        self._time, self._received = origin.time, now
        return True
