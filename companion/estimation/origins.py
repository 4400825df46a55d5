"""Selection of the valid GPS_GLOBAL_ORIGIN when messages overtake each other."""

from __future__ import annotations

from mavlink_bridge.messages import GpsGlobalOrigin

_OVERTAKEN = 2_000_000
"""µs; messages do not overtake each other by more.

An autopilot that reboots, and restarts its clock, needs longer than this until it has a position.
"""


class Origins:
    """Origin messages of one autopilot; the last one for which ``counts`` is true is its origin."""

    def __init__(self) -> None:
        self._time = self._received = 0

    def counts(self, now: int, origin: GpsGlobalOrigin) -> bool:
        """Return whether ``origin``, received at ``now`` (µs), is not an older one, late or resent.

        An older one must be rejected, because no later message would restore the newer one.
        """
        if 0 < origin.time < self._time and now - self._received <= _OVERTAKEN:
            return False
        self._time, self._received = origin.time, now
        return True
