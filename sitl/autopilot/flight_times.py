"""Times of the present or last flight, for FLIGHT_INFORMATION (264)."""

from __future__ import annotations


class FlightTimes:
    """Times of arming, take-off and landing (µs since boot, 0 for none), and the number of flights."""

    def __init__(self) -> None:
        self.armed_at = self.took_off_at = self.landed_at = self.count = 0
        self._armed, self._landed = False, True

    def watch(self, now: int, *, armed: bool, landed: bool) -> None:
        """Note changes at ``now`` (µs since boot)."""
        # 0 means none, also for a vehicle that boots in the air.
        now = max(1, now)
        if armed and not self._armed:
            self.armed_at, self.took_off_at, self.landed_at = now, 0, 0
        if self._landed and not landed:
            self.took_off_at, self.landed_at = now, 0
            self.count += 1
        if landed and not self._landed:
            self.landed_at = now
        self._armed, self._landed = armed, landed
