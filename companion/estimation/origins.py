"""Which GPS_GLOBAL_ORIGIN counts where they overtake each other."""

from __future__ import annotations

from mavlink_bridge.messages import GpsGlobalOrigin

_OVERTAKEN = 2_000_000
"""µs; messages do not overtake each other by more, and an autopilot that began anew, and its clock with it,
needs longer until it knows where it is."""


class Origins:
    """Those of one autopilot, of which the last one that ``counts`` is its origin."""

    def __init__(self) -> None:
        self._time = self._heard = 0

    def counts(self, now: int, origin: GpsGlobalOrigin) -> bool:
        """Whether ``origin``, heard at ``now`` (µs), is not one from before, late or sent again. Nothing
        would put the newer one right."""
        if 0 < origin.time < self._time and now - self._heard <= _OVERTAKEN:
            return False
        self._time, self._heard = origin.time, now
        return True
