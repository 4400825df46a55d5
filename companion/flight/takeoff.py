"""From the ground to where the escort begins: mode, arm, take-off, in the order of the autopilot."""

from __future__ import annotations

from math import inf

from companion.estimation.tracks import State
from companion.flight.autopilots import Profile, Step
from companion.flight.command_protocol import DO_SET_MODE, Commands
from companion.flight.vehicle import IN_AIR, ON_GROUND, UNDEFINED, Vehicle
from companion.values.horizon import Array
from mavlink_bridge.messages import Message

ARM_DISARM, NAV_TAKEOFF = 400, 22
_STILL, _CALM = 0.3, 2_000_000
"""m/s and µs: slower than this for so long in the air, a take-off is over."""
_NEARLY = 0.7
"""Share of the height asked for."""
_ENOUGH, _ROOM = 0.6, 0.2
"""An escort may begin on the way up above this share of the height asked for, and so many m above the floor
of plans: the autopilot takes the rest slowly, in up to 3 s."""
_THERE, _FAST = 0.3, 3.0
"""It may not begin more than so many m above that height, or at more than so many m/s."""
_NAN = float("nan")


class Takeoff:
    """The steps of one way up. ``start``: where the last of them began, (3,) m, fleet-local ENU."""

    def __init__(self, vehicle: Vehicle, calls: Commands, origin_altitude: float) -> None:
        """``origin_altitude``: of the fleet frame's zero, m above mean sea level."""
        self._vehicle = vehicle
        self._commands = calls
        self._origin_altitude = origin_altitude
        self.start: Array | None = None
        self._ground = 0.0
        self._flying_already = False
        self._calm_since: int | None = None
        self._step = 0
        self.asked_to_arm = 0
        """When (µs) it was last told to arm, 0 before the first time."""

    def begin(self, own: State) -> None:
        """From here, on the ground or where it flies already."""
        self.start = own.position.copy()
        self._ground = float(own.position[2])
        self._flying_already = self._vehicle.armed and self._vehicle.landed_state != ON_GROUND
        self._calm_since = None
        self._step = 0

    def step(self, profile: Profile) -> Step | None:
        """What is being done; None when all is."""
        return profile.steps[self._step] if self._step < len(profile.steps) else None

    def disarmed(self, profile: Profile) -> bool:
        """Whether it is disarmed again, by itself or by somebody, who will not expect it to arm."""
        return Step.ARM in profile.steps[: self._step] and not self._vehicle.armed

    def risen(self, own: State, height: float) -> bool:
        """Whether it is so near ``height`` (m above the ground) that the way up may have ended."""
        climbed = float(own.position[2]) - self._ground
        return not self._flying_already and climbed > _NEARLY * height

    def advance(
        self, now: int, profile: Profile, own: State, height: float, floor: float = inf
    ) -> list[Message]:
        """Commands to send now on the way to ``height`` (m above the ground). ``floor``: the lowest height
        (m, fleet-local) of plans that can go on with the way up; ∞ where they cannot."""
        vehicle = self._vehicle
        step = profile.steps[self._step]
        if step is Step.MODE:
            done = vehicle.in_guided_mode
            call = self._commands.call(now, DO_SET_MODE, profile.mode_call)
        elif step is Step.ARM:
            done = vehicle.armed
            call = self._commands.call(now, ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
            if call:
                self.asked_to_arm = now
        else:
            climbed = float(own.position[2]) - self._ground
            done = self._flying_already or self._is_up(now, own, climbed, height, floor)
            above_sea = self._origin_altitude + self._ground + height
            altitude = above_sea if profile.takeoff_absolute else height
            up = self._flying_already or vehicle.landed_state not in (UNDEFINED, ON_GROUND)
            call = (
                []
                if up
                else self._commands.call(now, NAV_TAKEOFF, (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, altitude))
            )
        if done:
            self._step += 1
            self._commands.forget()
            return []
        return call

    def _is_up(self, now: int, own: State, climbed: float, height: float, floor: float) -> bool:
        """High enough for plans to go on from there; still at the height asked for; or still for a while in
        the air, for an estimate of height that drifts by more than one may ask: the autopilot measures its
        height from its own origin."""
        speed = float(abs(own.velocity).max())
        still = speed < _STILL
        if self._vehicle.landed_state == ON_GROUND:
            self._calm_since = None
            return False
        if own.position[2] > floor + _ROOM and _ENOUGH * height < climbed < height + _THERE and speed < _FAST:
            return True
        if not still or self._vehicle.landed_state != IN_AIR or climbed < 0.5 * height:
            self._calm_since = None
        elif self._calm_since is None:
            self._calm_since = now
        waited = self._calm_since is not None and now - self._calm_since >= _CALM
        return waited or (still and abs(climbed - height) < 0.3)
