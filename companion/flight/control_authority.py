"""Control authority: the owner of the vehicle when its mode is no longer the guided mode.

A changed mode is intentional, set by a pilot's switch or by a ground station, and is left unchanged. There is
one exception: set-points were missing for so long that the autopilot's time-out ended the mode, and the
vehicle holds its position. Then the mode may be requested again. A change of mode while the autopilot was
silent counts as intentional, since it may have been a pilot.
"""

from __future__ import annotations

from enum import Enum

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.command_protocol import Commands
from companion.flight.vehicle import Vehicle
from mavlink_bridge.messages import Message

_MAX_GAP_US = 500_000
"""µs between set-points beyond which PX4's time-out (COM_OF_LOSS_T) may have ended the mode."""
_GAP_EFFECT_US = 2_000_000
"""µs after a gap during which a loss of the mode is attributed to the gap."""
_RECOVERY_TIMEOUT_US = 6_000_000
"""µs from the loss of the mode during which the mode is requested again."""


class Owner(Enum):
    """Owner of the vehicle; ``LOST``: a time-out ended the guided mode, and nobody controls the vehicle."""

    OURS = "ours"
    LOST = "lost by accident"
    TAKEN = "somebody else's"
    UNKNOWN = "not known"


class ControlAuthority:
    """Determines the owner of the vehicle, and requests the guided mode where a time-out has ended it.

    ``streamed`` must be called for every set-point sent, ``update`` in every step in which set-points are to
    steer, and ``release`` in every other step. ``calls``: the protocol that sends commands to the autopilot.
    ``owner``: the owner at the last update; ``OURS`` since a release.
    """

    def __init__(self, vehicle: Vehicle, calls: Commands) -> None:
        self._vehicle = vehicle
        self._commands = calls
        self.owner = Owner.OURS
        self._streamed: int | None = None
        self._gap_ended: int | None = None
        self._lost_at: int | None = None

    def begin(self) -> None:
        """Begin an escort: forget earlier set-points and losses."""
        self._streamed = self._gap_ended = self._lost_at = None

    def streamed(self, now: int) -> None:
        """Record that a set-point is sent at ``now`` (µs), and detect a gap before it."""
        if self._streamed is not None and now - self._streamed > _MAX_GAP_US:
            self._gap_ended = now
        self._streamed = now

    def update(self, now: int) -> Owner:
        """Update the owner at ``now`` (µs), and return it."""
        before, self.owner = self.owner, self._owner(now)
        if self.owner is Owner.LOST and before is not Owner.LOST:
            self._commands.forget()
        return self.owner

    def release(self) -> None:
        """Stop the requests for the guided mode: set-points are not to steer any more.

        Otherwise a vehicle that has lost this mode would never land.
        """
        self.owner = Owner.OURS

    def requests(self, now: int) -> list[Message]:
        """Return the request for the guided mode, if the autopilot's time-out has ended it."""
        profile = self._vehicle.profile
        if self.owner is not Owner.LOST or profile is None:
            return []
        return self._commands.call(now, mavlink.MAV_CMD_DO_SET_MODE, profile.mode_call)

    def _owner(self, now: int) -> Owner:
        """Return the owner at ``now`` (µs)."""
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
        return Owner.LOST if now - self._lost_at <= _RECOVERY_TIMEOUT_US else Owner.TAKEN

    def _is_accident(self, now: int) -> bool:
        beat, profile = self._vehicle.heartbeat, self._vehicle.profile
        if beat is None or profile is None or beat.custom_mode not in profile.loss_modes:
            return False
        if self._lost_at is not None:
            return True
        missing = self._streamed is not None and now - self._streamed > _MAX_GAP_US
        return missing or (self._gap_ended is not None and now - self._gap_ended <= _GAP_EFFECT_US)
