"""Whose the vehicle is when its mode is no longer the one in which set-points steer.

A mode that was changed is somebody's will, a pilot's by the switch or a ground station's, and is left alone.
One thing alone is an accident: set-points were missing for so long that the autopilot's time-out ended the
mode, and it holds its place. Then the mode may be asked for again. What happened while the autopilot was not
heard nobody has seen: that may have been a pilot.
"""

from __future__ import annotations

from enum import Enum

from companion.flight.vehicle import Vehicle

_GAP = 500_000
"""µs between set-points: PX4's shortest useful time-out, COM_OF_LOSS_T."""
_BLAME = 2_000_000
"""µs after a gap in which a loss of the mode is its consequence."""
_PATIENCE = 6_000_000
"""µs for which the mode is asked for again."""


class Owner(Enum):
    """Who has the vehicle."""

    OURS = "ours"
    LOST = "lost by accident"
    TAKEN = "somebody else's"
    UNKNOWN = "not known"


class ControlAuthority:
    """To be told of every set-point that leaves, and asked in every step of an escort."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._streamed: int | None = None
        self._gap_ended: int | None = None
        self._lost_at: int | None = None

    def begin(self) -> None:
        """It is ours from now on."""
        self._streamed = self._gap_ended = self._lost_at = None

    def streamed(self, now: int) -> None:
        """A set-point leaves at ``now`` (µs)."""
        if self._streamed is not None and now - self._streamed > _GAP:
            self._gap_ended = now
        self._streamed = now

    def owner(self, now: int) -> Owner:
        """At ``now`` (µs)."""
        vehicle = self._vehicle
        if not vehicle.alive:
            self._gap_ended, self._lost_at, self._streamed = None, None, now
            return Owner.UNKNOWN
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


class Passage:
    """The modes through which our own orders lead, up or down; any other is somebody's will. ``first``: the
    mode, custom_mode of HEARTBEAT, in which the order found the vehicle, which it has until the order
    tells."""

    def __init__(self, first: int) -> None:
        self._first = first
        self.entered = False
        """Whether the order has told."""

    def strays(self, mode: int, ways: frozenset[int], before: frozenset[int] = frozenset()) -> bool:
        """Whether ``mode`` is none of the ``ways``, nor, until one of those is seen, the first or one of
        ``before``."""
        if mode in ways:
            self.entered = True
            return False
        return self.entered or (mode != self._first and mode not in before)
