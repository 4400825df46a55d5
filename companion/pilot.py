"""The way into the air and back: connect → arm → take-off → escort → settle → land, by MAVLink commands, each
until acknowledged.

Nothing starts without an operator's go (a NAV_TAKEOFF addressed to the companion), and while the autopilot is
not in the mode in which our set-points steer, none are sent. Who takes the vehicle over by its mode keeps it
until they give it back so, or a new go is given.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from companion.autopilots import Profile, Step
from companion.calls import Calls
from companion.config import CompanionConfig
from companion.custody import Custody, Owner
from companion.horizon import Array
from companion.takeoff import DO_SET_MODE, NAV_TAKEOFF, Takeoff
from companion.vehicle import UNDEFINED, Vehicle
from companion.world import View
from mavlink_bridge.messages import CommandAck, Message, Source

__all__ = ["NAV_LAND", "NAV_TAKEOFF", "Phase", "Pilot"]

NAV_LAND = 21
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, GPS_GLOBAL_ORIGIN = 512, 511, 49
OPERATORS_GO = "the operator's go"
"""What it waits for when all else is ready."""
_NAN = float("nan")
_FAR = 20_000.0
"""m between the fleet origin and the autopilot's own: beyond, one of the two is wrong."""
_NEEDED = tuple(
    (SET_MESSAGE_INTERVAL, (identifier, interval, 0.0, 0.0, 0.0, 0.0, 0.0))
    for identifier, interval in ((32.0, 20_000.0), (30.0, 100_000.0), (1.0, 1_000_000.0), (245.0, 500_000.0))
)
"""Message id and interval (µs) asked of the autopilot: LOCAL_POSITION_NED, ATTITUDE, SYS_STATUS,
EXTENDED_SYS_STATE. The attitude tells only where the nose points when the set-points begin."""


class Phase(Enum):
    """Where the flight is."""

    CONNECT = "connect"
    PREPARE = "prepare"
    ESCORT = "escort"
    HOLD = "hold"
    RETURN = "return"
    SETTLE = "settle"
    LAND = "land"
    DONE = "done"
    YIELDED = "yielded"


STEERED = (Phase.ESCORT, Phase.HOLD, Phase.RETURN, Phase.SETTLE)
"""The phases in which set-points steer, as long as the autopilot lets them."""


class Pilot:
    """One vehicle's flight, as a state machine over what has been heard. It sends commands, never set-points.

    ``origin_altitude``: of the fleet frame's zero, m above mean sea level.
    """

    def __init__(self, config: CompanionConfig, own: Source, origin_altitude: float) -> None:
        self._config = config
        self.phase = Phase.CONNECT
        self.vehicle = Vehicle()
        self.waiting_for = "a heartbeat of the autopilot"
        self._settling_since: int | None = None
        self._height: float | None = None
        self._calls = Calls(own)
        self._custody = Custody(self.vehicle)
        self._owner = Owner.OURS
        self._takeoff = Takeoff(self.vehicle, self._calls, origin_altitude)

    @property
    def profile(self) -> Profile | None:
        """The autopilot's ways, None for one that is not known."""
        return self.vehicle.profile

    @property
    def said(self) -> str:
        """The last warning of the autopilot."""
        return self.vehicle.said

    @property
    def refusals(self) -> list[str]:
        """Commands that the autopilot refused, in words."""
        return self._calls.refusals

    @property
    def guided(self) -> bool:
        """Whether the autopilot follows our set-points now."""
        return self.vehicle.guided

    @property
    def streaming(self) -> bool:
        """Whether set-points are to be sent."""
        if self.phase in STEERED:
            return self.guided or self._owner is Owner.LOST
        profile = self.profile
        return (
            self.phase is Phase.PREPARE
            and profile is not None
            and profile.streams_first
            and self._takeoff.step(profile) is Step.MODE
        )

    def hear(self, message: Message) -> None:
        """A message of the own autopilot."""
        if isinstance(message, CommandAck):
            self._calls.hear(message)
        else:
            self.vehicle.hear(message)

    def go(self, height: float) -> bool:
        """The operator's go: climb to ``height`` metres above the start, or take over where it flies already;
        on the way back, or while it holds, go on with the escort. Whether it is taken."""
        if self.phase in (Phase.HOLD, Phase.RETURN, Phase.ESCORT):
            self.phase = Phase.ESCORT
            return True
        if self.phase not in (Phase.CONNECT, Phase.PREPARE, Phase.YIELDED) or not 0.5 <= height <= 120.0:
            return False
        if self.phase is Phase.YIELDED:
            self._start_anew()
        self._height = height
        return True

    def hold(self) -> bool:
        """The operator's order to stay where it is. Whether it is taken."""
        if self.phase in (Phase.ESCORT, Phase.RETURN):
            self.phase = Phase.HOLD
        return self.phase is Phase.HOLD

    def come_back(self) -> bool:
        """The operator's order to fly to where it started, and to land there. Whether it is taken."""
        if self.phase in (Phase.ESCORT, Phase.HOLD):
            self.phase = Phase.RETURN
        return self.phase in (Phase.RETURN, Phase.SETTLE, Phase.LAND)

    def streamed(self, now: int) -> None:
        """A set-point leaves at ``now`` (µs)."""
        self._custody.streamed(now)

    @property
    def start(self) -> Array | None:
        """Where it was at the last go, (3,) m, fleet-local ENU; on the ground, or where it was taken over."""
        return self._takeoff.start

    def land(self) -> bool:
        """The operator's order to land. A vehicle under way first comes to a hover clear of the others,
        because an autopilot that lands looks out for nobody."""
        if self.phase is Phase.CONNECT:
            # Nothing is in the air yet, and an earlier go is taken back.
            self._height = None
        if self.phase in STEERED:
            self.phase = Phase.SETTLE
        elif self.phase is Phase.PREPARE:
            self.phase = Phase.LAND
        return True

    def alight(self) -> None:
        """Something is so wrong that it has to land, by settling if that can be; whoever has taken the
        vehicle over keeps it."""
        if self.phase in STEERED:
            self.phase = Phase.SETTLE

    def returned(self) -> None:
        """It is where it started: settle and land."""
        if self.phase is Phase.RETURN:
            self.phase = Phase.SETTLE

    def settled(self) -> None:
        """The vehicle hovers clear of the others: land now."""
        if self.phase is Phase.SETTLE:
            self.phase = Phase.LAND

    def step(self, now: int, view: View) -> list[Message]:
        """Commands to send now."""
        self.vehicle.tick(now)
        if self.phase in STEERED:
            self._keep(now)
        if self.phase is Phase.SETTLE:
            self._settle(now, view)
        if self.phase not in STEERED:
            # What is not wanted any more is not asked for, or who was thrown out of its mode never lands.
            self._owner = Owner.OURS
        if self._owner is Owner.LOST:
            return self._ask_back(now)
        if self.phase is Phase.YIELDED:
            self._look_for_a_return()
        if self.phase is Phase.CONNECT:
            return self._connect(now, view)
        if self.phase is Phase.PREPARE:
            return self._prepare(now, view)
        if self.phase is Phase.LAND:
            if self.vehicle.heartbeat is not None and not self.vehicle.armed:
                self.phase = Phase.DONE
                return []
            return self._calls.call(now, NAV_LAND, (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, 0.0))
        return []

    def _keep(self, now: int) -> None:
        """See whose the vehicle is. Somebody who took it over keeps it: nothing is ordered against them."""
        before, self._owner = self._owner, self._custody.owner(now)
        if self._owner is Owner.TAKEN:
            self._owner = Owner.OURS
            self._yielded_from, self.phase = self.phase, Phase.YIELDED
            self._calls.forget()
        elif self._owner is Owner.LOST and before is not Owner.LOST:
            self._calls.forget()

    def _ask_back(self, now: int) -> list[Message]:
        """For the mode that nobody but the time-out has ended."""
        if self.profile is None:
            return []
        return self._calls.call(now, DO_SET_MODE, (*self.profile.mode_params, 0.0, 0.0, 0.0, 0.0))

    def _look_for_a_return(self) -> None:
        """Who took the vehicle over may give it back by its mode switch; who disarms it ends the flight."""
        if self.guided:
            self.phase = self._yielded_from
            self._custody.begin()
        elif self.vehicle.alive and not self.vehicle.armed:
            self._start_anew()
            self._height = None

    def _start_anew(self) -> None:
        self.phase, self._owner, self._settling_since = Phase.CONNECT, Owner.OURS, None
        self._calls.forget()

    def _settle(self, now: int, view: View) -> None:
        """Land without settling when that cannot go on: blind, or too long."""
        since = self._settling_since = now if self._settling_since is None else self._settling_since
        blind = view.own is None or view.own.age > self._config.guard.own_stale_us
        if blind or now - since > self._config.guard.settle_us:
            self.phase = Phase.LAND

    def _requests(self, now: int, view: View) -> list[Message]:
        """For the messages that are needed; they change nothing of what the vehicle does."""
        calls: list[Message] = []
        if self.vehicle.heartbeat is not None:
            for command, params in sorted(_NEEDED, key=lambda call: self._calls.sent_at(*call)):
                calls += self._calls.call(now, command, params)
            if view.local is None:
                calls += self._calls.call(
                    now, REQUEST_MESSAGE, (GPS_GLOBAL_ORIGIN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                )
        return calls

    def _connect(self, now: int, view: View) -> list[Message]:
        self.waiting_for = self._missing(view)
        calls = self._requests(now, view)
        if not self.waiting_for and view.own is not None and view.local is not None:
            self._takeoff.begin(view.own)
            self.phase = Phase.PREPARE
        return calls

    def _unseen(self, view: View) -> str:
        """What has not been heard that every plan needs."""
        vehicle = self.vehicle
        if vehicle.heartbeat is None:
            return "a heartbeat of the autopilot"
        if vehicle.profile is None:
            kind = vehicle.heartbeat.autopilot
            return f"an autopilot that is known (ArduPilot 3, PX4 12; this is {kind})"
        if view.local is None:
            return "GPS_GLOBAL_ORIGIN"
        far = float(np.linalg.norm(view.local.origin_fleet))
        if not far < _FAR:
            return f"a fleet origin that is not {far / 1000.0:.0f} km away from the vehicle's"
        if view.own is None or view.own.age > self._config.guard.own_stale_us:
            return "LOCAL_POSITION_NED"
        return "" if view.yaw is not None else "ATTITUDE"

    def _missing(self, view: View) -> str:
        vehicle = self.vehicle
        if unseen := self._unseen(view):
            return unseen
        if vehicle.armed and vehicle.landed_state == UNDEFINED:
            # A vehicle that may be flying must not be told to take off.
            return "EXTENDED_SYS_STATE, whether the armed vehicle is on the ground"
        if not vehicle.healthy:
            return "the autopilot's pre-arm checks"
        if not all(self._calls.answered(*call) for call in _NEEDED):
            return "the autopilot's answers to SET_MESSAGE_INTERVAL"
        if self._height is None:
            return OPERATORS_GO
        return ""

    def _prepare(self, now: int, view: View) -> list[Message]:
        profile, height, takeoff = self.profile, self._height, self._takeoff
        if profile is None or height is None or view.own is None:
            return []
        if takeoff.disarmed(profile):
            # A new go is needed.
            self._height, self.phase = None, Phase.CONNECT
            self._calls.forget()
            return []
        step = takeoff.step(profile)
        sent = takeoff.advance(now, profile, view.own, height)
        if takeoff.step(profile) is None:
            self.phase = Phase.ESCORT
            self._custody.begin()
        elif step is not None and takeoff.step(profile) is step:
            self.waiting_for = step.value
        return sent
