"""Descent, from settling to the end of the flight: wait for the landing, land, leave the guided mode."""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.estimation.tracks import State
from companion.flight.command_protocol import Commands
from companion.flight.landing import Landing, landed
from companion.flight.passage import Passage
from companion.flight.vehicle import Vehicle
from companion.values.horizon import Array
from mavlink_bridge.messages import Message

_NAN = float("nan")
_ARM_REPORT_US = 2_000_000
"""µs after the last arm command during which a heartbeat may still report the vehicle as disarmed."""
_LANDED_US = 2_500_000
"""µs for which the vehicle is disarmed and on the ground before it has landed: more than two heartbeats."""
_LEAVE_TIMEOUT_US = 5_000_000
"""µs after landing during which the hold mode is requested."""


class Descent:
    """Descent of one ``vehicle``; ``calls``: the protocol that sends commands to its autopilot.

    ``due`` is called in every step of settling, ``begin`` once, then ``strays`` and ``step`` in every step of
    the landing. ``clear``: whether the settling vehicle hovers clear of the others. ``landing``: the last
    landing, None before the first. ``over``: whether the flight has ended.
    """

    def __init__(self, config: CompanionConfig, vehicle: Vehicle, calls: Commands) -> None:
        self._config = config
        self._vehicle = vehicle
        self._commands = calls
        self.clear = False
        self.landing: Landing | None = None
        self.over = False
        self._settling_since: int | None = None
        self._start: Array | None = None
        self._returning = False
        self._asked_to_arm = 0
        self._landed_at: int | None = None
        self._passage = Passage(0)

    def forget(self) -> None:
        """Forget an earlier settling."""
        self.clear, self._settling_since = False, None

    def due(self, now: int, own: State | None, *, reserved: bool) -> bool:
        """Return whether the settling vehicle is to land at ``now`` (µs).

        That is so if it is clear of the others and its column is ``reserved``, if its state ``own`` is stale
        or if the time limit is exceeded. The last two do not wait for a reservation.
        """
        since = self._settling_since = now if self._settling_since is None else self._settling_since
        blind = own is None or own.age > self._config.guard.own_stale_us
        return (self.clear and reserved) or blind or now - since > self._config.guard.settle_us

    def begin(self, start: Array | None, asked_to_arm: int, *, returning: bool) -> None:
        """Begin the landing.

        ``start``: position (3,) m, fleet-local ENU, at the last take-off or take-over, None before the first.
        ``asked_to_arm``: when (µs) the last arm command was sent, 0 before the first. ``returning``: whether
        the vehicle was returning to its start.
        """
        self._start, self._asked_to_arm, self._returning = start, asked_to_arm, returning
        self._landed_at, self.over = None, False
        self.clear = False
        self._commands.forget()
        self._passage = Passage(self._vehicle.mode)

    def strays(self) -> bool:
        """Return whether another controller has taken the landing vehicle over by a change of mode."""
        vehicle, profile = self._vehicle, self._vehicle.profile
        if profile is None or not vehicle.alive or not vehicle.flies:
            return False
        # Without set-points the autopilot may hold its position until the command arrives.
        before = profile.loss_modes | {profile.guided_custom_mode}
        return self._passage.strays(vehicle.mode, profile.land_modes, before)

    def step(self, now: int, own: State | None) -> list[Message]:
        """Return the landing command until it takes effect; after the landing, what ``_leave`` returns.

        The vehicle has landed when its autopilot has said for ``_LANDED_US``, and nothing else, that it is
        disarmed and on the ground: a single message may be another sender's. Without any report of the landed
        state it must be disarmed for 10 s (``Vehicle.rested_for``).
        The command is not repeated after it took effect: if the autopilot then leaves its landing mode,
        another controller has ordered that. The command is not sent while the autopilot is silent, because a
        pilot may have the vehicle.
        """
        vehicle = self._vehicle
        if vehicle.heartbeat is not None and not vehicle.armed:
            reported = vehicle.beat_at - self._asked_to_arm > _ARM_REPORT_US
            return self._leave(now, own) if reported and self._rests() else []
        if not vehicle.alive or self._passage.entered:
            return []
        return self._commands.call(now, mavlink.MAV_CMD_NAV_LAND, (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, 0.0))

    def _rests(self) -> bool:
        """Return whether the vehicle has landed."""
        return self._landed_at is not None or self._vehicle.rested_for >= _LANDED_US

    def _leave(self, now: int, own: State | None) -> list[Message]:
        """Return the mode command after disarming, and end the flight.

        PX4 may remain in guided mode, where its checks before the next flight fail. So in guided and landing
        modes the hold mode is requested for up to 5 s.
        """
        vehicle, profile = self._vehicle, self._vehicle.profile
        if self._landed_at is None:
            self._landed_at = now
            self._commands.forget()
            doubt, returning = vehicle.positioning.radius, self._returning
            self.landing = landed(self._config, self._start, own, doubt, returning=returning)
        if profile is not None and profile.streams_first and now - self._landed_at <= _LEAVE_TIMEOUT_US:
            if not vehicle.alive:
                return []
            if vehicle.mode in profile.land_modes | {profile.guided_custom_mode}:
                return self._commands.call(now, mavlink.MAV_CMD_DO_SET_MODE, profile.hold_call)
        self.over = True
        return []
