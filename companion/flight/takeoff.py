"""Take-off, from the ground to where the escort begins: mode, arm, climb, in the autopilot's order."""

from __future__ import annotations

from math import inf

from pymavlink.dialects.v20 import all as mavlink

from companion.estimation.tracks import State
from companion.flight.autopilots import Profile, Step
from companion.flight.command_protocol import Commands
from companion.flight.vehicle import Vehicle
from companion.values.horizon import Array
from mavlink_bridge.messages import Message

_STILL, _CALM = 0.3, 2_000_000
"""m/s and µs: a vehicle slower than this in the air for so long has finished its take-off."""
_NEARLY = 0.7
"""Share of the requested height."""
_ENOUGH, _ROOM = 0.6, 0.2
"""Share of the requested height, and distance (m) above the floor of plans.

An escort may begin during the climb above both: the autopilot takes up to 3 s for the slow rest.
"""
_THERE, _FAST = 0.3, 3.0
"""m above the requested height, and m/s, beyond which the escort may not begin during the climb."""
_NOT_UP = (mavlink.MAV_LANDED_STATE_UNDEFINED, mavlink.MAV_LANDED_STATE_ON_GROUND)
_NAN = float("nan")


class Takeoff:
    """The steps of one take-off; ``start``: where the last one began, (3,) m, fleet-local ENU."""

    def __init__(self, vehicle: Vehicle, calls: Commands, origin_altitude: float) -> None:
        """Take ``origin_altitude``: altitude of the fleet frame's zero, m above mean sea level."""
        self._vehicle = vehicle
        self._commands = calls
        self._origin_altitude = origin_altitude
        self.start: Array | None = None
        self._ground = 0.0
        self._flying_already = False
        self._calm_since: int | None = None
        self._step = 0
        self.asked_to_arm = 0
        """When (µs) the last arm command was sent, 0 before the first."""

    def begin(self, own: State) -> None:
        """Begin at the state ``own``, on the ground or in flight."""
        self.start = own.position.copy()
        self._ground = float(own.position[2])
        self._flying_already = self._vehicle.flies
        self._calm_since = None
        self._step = 0

    def step(self, profile: Profile) -> Step | None:
        """Return the present step; None when all are done."""
        return profile.steps[self._step] if self._step < len(profile.steps) else None

    def disarmed(self, profile: Profile) -> bool:
        """Return whether the vehicle is disarmed again, after it was armed.

        It was disarmed by itself or by another controller, which does not expect it to arm again.
        """
        return Step.ARM in profile.steps[: self._step] and not self._vehicle.armed

    def risen(self, own: State, height: float) -> bool:
        """Return whether the climb to ``height`` (m above the ground) may be over.

        That is so above ``_NEARLY`` of it, unless the vehicle was in flight when the take-off began.
        """
        climbed = float(own.position[2]) - self._ground
        return not self._flying_already and climbed > _NEARLY * height

    def advance(
        self, now: int, profile: Profile, own: State, height: float, floor: float = inf
    ) -> list[Message]:
        """Return the commands to send at ``now`` (µs) on the way to ``height`` (m above the ground).

        ``floor``: the lowest height (m, fleet-local) of plans that can take over during the climb; ∞ where
        they cannot.
        """
        vehicle = self._vehicle
        step = profile.steps[self._step]
        if step is Step.MODE:
            done = vehicle.in_guided_mode
            call = self._commands.call(now, mavlink.MAV_CMD_DO_SET_MODE, profile.mode_call)
        elif step is Step.ARM:
            done = vehicle.armed
            arm = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            call = self._commands.call(now, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, arm)
            if call:
                self.asked_to_arm = now
        else:
            climbed = float(own.position[2]) - self._ground
            done = self._flying_already or self._is_up(now, own, climbed, height, floor)
            above_sea = self._origin_altitude + self._ground + height
            altitude = above_sea if profile.takeoff_absolute else height
            up = self._flying_already or vehicle.landed_state not in _NOT_UP
            climb = (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, altitude)
            call = [] if up else self._commands.call(now, mavlink.MAV_CMD_NAV_TAKEOFF, climb)
        if done:
            self._step += 1
            self._commands.forget()
            return []
        return call

    def _is_up(self, now: int, own: State, climbed: float, height: float, floor: float) -> bool:
        """Return whether the take-off is over.

        It is over if the vehicle is high enough for plans to take over, if it is still at the requested
        height, or if it has been still in the air for a while. The last condition is needed because the
        estimated height may have drifted by more than the tolerance: the autopilot measures its height from
        its own origin.
        """
        speed = float(abs(own.velocity).max())
        still = speed < _STILL
        if self._vehicle.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND:
            self._calm_since = None
            return False
        if own.position[2] > floor + _ROOM and _ENOUGH * height < climbed < height + _THERE and speed < _FAST:
            return True
        in_air = self._vehicle.landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
        if not still or not in_air or climbed < 0.5 * height:
            self._calm_since = None
        elif self._calm_since is None:
            self._calm_since = now
        waited = self._calm_since is not None and now - self._calm_since >= _CALM
        return waited or (still and abs(climbed - height) < 0.3)
