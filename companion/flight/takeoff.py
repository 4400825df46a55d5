"""Take-off, from the ground to the begin of the escort: mode, arm, climb, in the autopilot's order."""

from __future__ import annotations

from math import inf

from pymavlink.dialects.v20 import all as mavlink

from companion.estimation.tracks import State
from companion.flight.autopilots import Profile, Step
from companion.flight.command_protocol import Commands
from companion.flight.passage import Passage
from companion.flight.vehicle import Vehicle
from companion.values.horizon import Array
from mavlink_bridge.messages import Message

_REST_SPEED, _REST_TIME_US = 0.3, 2_000_000
"""m/s and µs: a vehicle in the air that is slower for so long has finished its take-off.

It must be above half of the requested height.
"""
_RISEN_SHARE = 0.7
"""Share of the requested height above which the climb may be over and the mode may have changed."""
_ESCORT_SHARE, _FLOOR_CLEARANCE = 0.6, 0.2
"""Share of the requested height, and distance (m) above the lowest height of plans.

An escort may begin during the climb above both heights: the autopilot takes up to 3 s for the slow end of the
climb.
"""
_MAX_OVERSHOOT, _MAX_ESCORT_SPEED = 0.3, 3.0
"""m above the requested height, and m/s, beyond which the escort may not begin during the climb."""
_MODE_REPORT_US = 1_500_000
"""µs after the transmission of an accepted mode command; so long the mode is assumed without a heartbeat."""
_NOT_FLYING = (mavlink.MAV_LANDED_STATE_UNDEFINED, mavlink.MAV_LANDED_STATE_ON_GROUND)
_NAN = float("nan")


class Takeoff:
    """Steps of a take-off; ``start``: where the last take-off began, (3,) m, fleet-local ENU."""

    def __init__(self, vehicle: Vehicle, calls: Commands, origin_altitude: float) -> None:
        """Take ``origin_altitude``: altitude of the fleet frame's zero, m above mean sea level."""
        self._vehicle = vehicle
        self._commands = calls
        self._origin_altitude = origin_altitude
        self.start: Array | None = None
        self._ground = 0.0
        self._flying_already = False
        self._at_rest_since: int | None = None
        self._step = 0
        self._passage = Passage(0)
        self.waiting_for = ""
        """What the last unfinished step waits for; an empty string before the first."""
        self.asked_to_arm = 0
        """When (µs) the last arm command was sent, 0 before the first."""

    def begin(self, own: State) -> None:
        """Begin at the state ``own``, on the ground or in flight."""
        self.start = own.position.copy()
        self._ground = float(own.position[2])
        self._flying_already = self._vehicle.flies
        self._at_rest_since = None
        self._step = 0
        self._passage = Passage(self._vehicle.mode)
        self.waiting_for = ""

    @property
    def began_in_flight(self) -> bool:
        """Whether the vehicle flew already when the last take-off began."""
        return self._flying_already

    def step(self, profile: Profile) -> Step | None:
        """Return the present step; None when all are done."""
        return profile.steps[self._step] if self._step < len(profile.steps) else None

    def disarmed(self, profile: Profile) -> bool:
        """Return whether the vehicle is disarmed again, after it was armed.

        The autopilot or another controller disarmed it, and must not be overridden by arming it again.
        """
        return Step.ARM in profile.steps[: self._step] and not self._vehicle.armed

    @property
    def streams(self) -> bool:
        """Whether set-points are to be sent because the autopilot requires them to enter the guided mode."""
        profile = self._vehicle.profile
        return (
            self._vehicle.alive
            and profile is not None
            and profile.streams_first
            and self.step(profile) is Step.MODE
        )

    def mode_accepted(self, now: int) -> bool:
        """Return whether the autopilot has just accepted the guided mode.

        PX4 reports the mode in its next heartbeat, up to a second later.
        """
        profile = self._vehicle.profile
        return profile is not None and self._commands.taken(
            now, mavlink.MAV_CMD_DO_SET_MODE, profile.mode_call, _MODE_REPORT_US
        )

    def strays(self, profile: Profile, own: State | None, height: float) -> bool:
        """Return whether another controller has taken the vehicle over by a change of mode.

        ``height``: the requested height (m above the ground).
        """
        ways = profile.takeoff_modes | {profile.guided_custom_mode}
        if own is not None and self._risen(own, height):
            ways |= {profile.hold_mode}
        return self._passage.strays(self._vehicle.mode, ways)

    def _risen(self, own: State, height: float) -> bool:
        """Return whether the climb to ``height`` (m above the ground) may be over.

        That is so above ``_RISEN_SHARE`` of the height, unless the take-off began in flight.
        """
        climbed = float(own.position[2]) - self._ground
        return not self._flying_already and climbed > _RISEN_SHARE * height

    def advance(
        self,
        now: int,
        profile: Profile,
        own: State,
        height: float,
        floor: float = inf,
        column_waits: str = "",
    ) -> list[Message]:
        """Return the commands to send at ``now`` (µs) on the way to ``height`` (m above the ground).

        ``floor``: the lowest height (m, fleet-local) of plans that can take over during the climb; ∞ where
        they cannot. ``column_waits``: what the climb must wait for; an empty string: nothing.
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
            up = self._flying_already or vehicle.landed_state not in _NOT_FLYING
            climb = (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, altitude)
            waits = up or bool(column_waits)
            call = [] if waits else self._commands.call(now, mavlink.MAV_CMD_NAV_TAKEOFF, climb)
        if done:
            self._step += 1
            self._commands.forget()
            return []
        self.waiting_for = column_waits if column_waits and step is Step.TAKEOFF else step.value
        return call

    def _is_up(self, now: int, own: State, climbed: float, height: float, floor: float) -> bool:
        """Return whether the take-off is over.

        It is over if the vehicle is high and slow enough for plans to take over, if it is at rest within
        0.3 m of the requested height, or if it has been at rest for 2 s above half of that height. The last
        condition is needed because the estimated height may have drifted by more than 0.3 m: the autopilot
        measures its height from its own origin.
        """
        speed = float(abs(own.velocity).max())
        at_rest = speed < _REST_SPEED
        if self._vehicle.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND:
            self._at_rest_since = None
            return False
        if (
            own.position[2] > floor + _FLOOR_CLEARANCE
            and _ESCORT_SHARE * height < climbed < height + _MAX_OVERSHOOT
            and speed < _MAX_ESCORT_SPEED
        ):
            return True
        in_air = self._vehicle.landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
        if not at_rest or not in_air or climbed < 0.5 * height:
            self._at_rest_since = None
        elif self._at_rest_since is None:
            self._at_rest_since = now
        waited = self._at_rest_since is not None and now - self._at_rest_since >= _REST_TIME_US
        return waited or (at_rest and abs(climbed - height) < 0.3)
