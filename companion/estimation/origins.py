"""Selection of the valid GPS_GLOBAL_ORIGIN when messages overtake each other."""

from __future__ import annotations

from collections import deque

from mavlink_bridge.messages import GpsGlobalOrigin

_MAX_OVERTAKING_US = 2_000_000
"""Longest time by which messages overtake each other.

An autopilot that reboots, and thereby restarts its clock, takes longer than this to find a position.
"""


_KEPT = 8
"""Number of earlier origins that are recognised."""
_Place = tuple[float, float, float]
"""Latitude and longitude (deg), altitude (m)."""


class Origins:
    """Origin messages of one autopilot; the last one for which ``counts`` is true is its origin."""

    def __init__(self) -> None:
        self._time = self._received = 0
        self._place: _Place | None = None
        self._earlier: deque[_Place] = deque(maxlen=_KEPT)

    def counts(self, now: int, origin: GpsGlobalOrigin) -> bool:
        """Return whether ``origin``, received at ``now`` (µs), is to be used.

        It is not to be used if the last used origin was received at most 2 s before and is newer: ``origin``
        is then late or resent. It is older if its time stamp is, or, without a time stamp (0), if it has the
        place of an origin before the last one. Any other origin without a time stamp is used; the answer to
        the next request (``Readiness.confirm_origin``) shows whether it is the newest.
        """
        place = origin.latitude, origin.longitude, origin.altitude
        if now - self._received <= _MAX_OVERTAKING_US:
            old = 0 < origin.time < self._time
            if old or (origin.time == 0 and place != self._place and place in self._earlier):
                return False
        if self._place is not None and place != self._place:
            self._earlier.append(self._place)
        self._place = place
        if origin.time:
            self._time = origin.time
        self._received = now
        return True
