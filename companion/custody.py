"""Whose the vehicle is when its mode is no longer the one in which set-points steer.

A mode that was changed is somebody's will, a pilot's by the switch or a ground station's, and is left alone.
One thing alone is an accident: set-points were missing for so long that the autopilot's time-out ended the
mode, and it is in a mode that it chooses then. That mode may be asked for again.
"""

from __future__ import annotations

from enum import Enum

from companion.vehicle import Vehicle

_GAP = 400_000
"""µs between set-points; PX4's shortest useful time-out is half a second."""
_BLAME = 4_000_000
"""µs after a gap in which a loss of the mode is its consequence."""
_PATIENCE = 6_000_000
"""µs for which the mode is asked for again."""


class Owner(Enum):
    """Who has the vehicle."""

    OURS = "ours"
    LOST = "lost by accident"
    TAKEN = "somebody else's"
    UNKNOWN = "not known"


class Custody:
    """To be told of every set-point that leaves, and asked in every step of an escort."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._streamed: int | None = None
        self._gap_ended: int | None = None
        self._lost_at: int | None = None
        self._silent = False

    def begin(self) -> None:
        """It is ours from now on."""
        self._streamed = self._gap_ended = self._lost_at = None
        self._silent = False

    def streamed(self, now: int) -> None:
        """A set-point leaves at ``now`` (µs)."""
        if self._streamed is not None and now - self._streamed > _GAP:
            self._gap_ended = now
        self._streamed = now

    def owner(self, now: int) -> Owner:
        """At ``now`` (µs)."""
        vehicle = self._vehicle
        if not vehicle.alive:
            # What happened meanwhile was not seen: our set-points may not have arrived.
            self._silent = True
            return Owner.UNKNOWN
        if self._silent:
            self._silent, self._gap_ended = False, now
        if vehicle.guided:
            self._lost_at = None
            return Owner.OURS
        if not vehicle.armed or not self._is_accident(now):
            return Owner.TAKEN
        if self._lost_at is None:
            self._lost_at = now
        return Owner.LOST if now - self._lost_at <= _PATIENCE else Owner.TAKEN

    def _is_accident(self, now: int) -> bool:
        beat, profile = self._vehicle.heartbeat, self._vehicle.profile
        if beat is None or profile is None or beat.custom_mode not in profile.loss_modes:
            return False
        if self._lost_at is not None:
            return True
        missing = self._streamed is not None and now - self._streamed > _GAP
        return missing or (self._gap_ended is not None and now - self._gap_ended <= _BLAME)
