"""The way into the air and back: connect → arm → take-off → escort → settle → land, by MAVLink commands, each
until acknowledged.

Nothing starts without an operator's go (a NAV_TAKEOFF addressed to the companion), which does not keep for
long, and while the autopilot is not in the mode in which our set-points steer, none are sent. Who takes the
vehicle over by its mode, on the way up and down too, keeps it until a new go is given.
"""

from __future__ import annotations

from math import inf

from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig
from companion.flight.autopilot_limits import AutopilotLimits
from companion.flight.autopilots import Loop, Profile, Step
from companion.flight.command_protocol import DO_SET_MODE, Commands
from companion.flight.control_authority import ControlAuthority, Owner, Passage
from companion.flight.landing import Landing, landed
from companion.flight.readiness import Readiness
from companion.flight.takeoff import NAV_TAKEOFF, Takeoff
from companion.flight.vehicle import Vehicle
from companion.values.horizon import Array
from companion.values.phase import STEERED, Phase
from companion.world import View
from mavlink_bridge.messages import CommandAck, Message, ParamValue, Source

__all__ = ["NAV_LAND", "NAV_TAKEOFF", "Phase", "Pilot"]

NAV_LAND = 21
_NAN = float("nan")
_ARMS = 2_000_000
"""µs after the last asking to arm in which a heartbeat may still say that it is not."""
_BEATS = 1_500_000
"""µs from an order of the mode until a heartbeat has to show it."""
_LEAVES = 5_000_000
"""µs after landing for which another mode is asked for."""


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
        self._landed_at: int | None = None
        self._returning = False
        self.landing: Landing | None = None
        """Where it has landed; None before."""
        self._height: float | None = None
        self._go_at: int | None = None
        self._passage = Passage(0)
        self._commands = Commands(own)
        self._readiness = Readiness(config, self.vehicle, self._commands)
        self._authority = ControlAuthority(self.vehicle)
        self._owner = Owner.OURS
        self._arming = 0
        self._takeoff = Takeoff(self.vehicle, self._commands, origin_altitude)

    @property
    def profile(self) -> Profile | None:
        """The autopilot's ways, None for one that is not known."""
        return self.vehicle.profile

    @property
    def limits(self) -> AutopilotLimits:
        """What the autopilot can follow."""
        return self._readiness.limits

    @property
    def loop(self) -> Loop | None:
        """Its gains, None for an autopilot that is not known."""
        profile = self.profile
        return self.limits.lowered.loop or (None if profile is None else profile.loop)

    @property
    def said(self) -> str:
        """The last warning of the autopilot."""
        return self.vehicle.said

    @property
    def refusals(self) -> list[str]:
        """Commands that the autopilot refused last, in words."""
        return list(self._commands.refusals)

    @property
    def refused(self) -> int:
        """How many refusals there were."""
        return self._commands.refused

    @property
    def guided(self) -> bool:
        """Whether the autopilot follows our set-points now."""
        return self.vehicle.guided

    def steers(self, now: int) -> bool:
        """Whether the autopilot follows our set-points, or has just taken the mode in which it does: PX4's
        next heartbeat, up to a second later, says so."""
        profile = self.profile
        if self.guided or profile is None or self.phase is not Phase.PREPARE or not self.streaming:
            return self.guided
        return self._commands.taken(now, DO_SET_MODE, profile.mode_call, _BEATS)

    @property
    def streaming(self) -> bool:
        """Whether set-points are to be sent."""
        if self.phase in STEERED:
            return self.guided or self._owner is Owner.LOST
        profile = self.profile
        return (
            self.phase is Phase.PREPARE
            and self.vehicle.alive
            and profile is not None
            and profile.streams_first
            and self._takeoff.step(profile) is Step.MODE
        )

    def receive(self, message: Message) -> None:
        """A message of the own autopilot."""
        if isinstance(message, CommandAck):
            self._commands.receive(message)
            self._readiness.receive(message)
        elif isinstance(message, ParamValue):
            self.limits.receive(message)
        else:
            self.vehicle.receive(message)

    def _floor(self, view: View) -> float:
        """Above which height (m, fleet-local) an escort may begin on the way up; ∞ without a target, where it
        would stay there, and where plans are committed, which begin at rest."""
        config = self._config
        if config.task != "escort" or config.avoidance == "certified" or view.target is None:
            return inf
        return config.limits.within(config.field.margin(1)).box_min[2]

    def go(self, height: float) -> bool:
        """The operator's go: climb to ``height`` metres above the start, or take over where it flies already;
        on the way back, or while it holds, go on with the escort. Whether it is taken: not from the ground by
        a vehicle that cannot fly an escort as its parameters are."""
        if self.phase in (Phase.HOLD, Phase.RETURN, Phase.ESCORT):
            self.phase, self._returning = Phase.ESCORT, False
            return True
        if self.phase not in (Phase.CONNECT, Phase.PREPARE, Phase.YIELDED) or not 0.5 <= height <= 120.0:
            return False
        if self.phase is Phase.PREPARE and self._height not in (None, height):
            # The autopilot may have been told the other height already.
            return False
        if self.phase is Phase.CONNECT and self.limits.refuses:
            return False
        if self.phase is Phase.YIELDED:
            self._start_anew()
        self._height, self._go_at = height, None
        return True

    def take_back(self) -> None:
        """A go that waits for something is none; one that has begun goes on."""
        if self.phase is Phase.CONNECT:
            self._height = None

    def hold(self) -> bool:
        """The operator's order to stay where it is. Whether it is taken."""
        if self.phase in (Phase.ESCORT, Phase.RETURN):
            self.phase, self._returning = Phase.HOLD, False
        return self.phase is Phase.HOLD

    def come_back(self) -> bool:
        """The operator's order to fly to where it started, and to land there. Whether it is taken."""
        if self.phase in (Phase.ESCORT, Phase.HOLD):
            self.phase, self._returning = Phase.RETURN, True
        return self.phase in (Phase.RETURN, Phase.SETTLE, Phase.LAND)

    def streamed(self, now: int) -> None:
        """A set-point leaves at ``now`` (µs)."""
        self._authority.streamed(now)

    @property
    def start(self) -> Array | None:
        """Where it was at the last go, (3,) m, fleet-local ENU; on the ground, or where it was taken over."""
        return self._takeoff.start

    def land(self) -> bool:
        """The operator's order to land. A vehicle under way first comes to a hover clear of the others,
        because an autopilot that lands looks out for nobody. Whether it is taken: not for a vehicle that
        somebody else has, nor for one in the air that is not as we would leave it, nor for one that is not
        heard, but that a go is taken back."""
        if self.phase in STEERED:
            # Where it is, from now on, if it was still on its way.
            self._returning = self._returning and self.phase is not Phase.RETURN
            self.phase = Phase.SETTLE
        elif self.phase is Phase.PREPARE:
            self._alight()
        elif self.phase is Phase.CONNECT:
            waited = self._height is not None
            self.take_back()
            if not self.vehicle.alive:
                # Whether it flies, and whose it is, is not known.
                return waited
            if self.vehicle.flies:
                if not self.vehicle.left_by_us:
                    return False
                self._alight()
        return self.phase is not Phase.YIELDED

    def alight(self) -> None:
        """Something is so wrong that it has to land, by settling if that can be; whoever has taken the
        vehicle over keeps it."""
        if self.phase in STEERED:
            self.phase = Phase.SETTLE

    @property
    def planned_limits(self) -> LimitsConfig:
        """Limits that plans keep: as configured, lowered to what the autopilot can follow."""
        return self.limits.lowered.limits

    def returned(self) -> None:
        """It is where it started: settle and land."""
        if self.phase is Phase.RETURN:
            self.phase = Phase.SETTLE

    def settled(self) -> None:
        """The vehicle hovers clear of the others: land now."""
        if self.phase is Phase.SETTLE:
            self._alight()

    def _alight(self) -> None:
        self.phase, self._landed_at = Phase.LAND, None
        self._arming = self._takeoff.asked_to_arm
        self._commands.forget()
        self._passage = Passage(self.vehicle.mode)

    def step(self, now: int, view: View) -> list[Message]:
        """Commands to send now."""
        self.vehicle.tick(now)
        commands = self._act(now, view)
        connected = self.phase is not Phase.CONNECT or self._readiness.heard
        return [*commands, *self._readiness.wishes(now)] if connected else commands

    def _act(self, now: int, view: View) -> list[Message]:
        if self.phase in STEERED:
            self._keep(now)
        if self.phase is Phase.SETTLE:
            self._settle(now, view)
        if self.phase not in STEERED:
            # What is not wanted any more is not asked for, or who was thrown out of its mode never lands.
            self._owner = Owner.OURS
        if self._owner is Owner.LOST:
            return self._ask_back(now)
        if self.phase is Phase.YIELDED and self.vehicle.alive and not self.vehicle.armed:
            # Who disarms it ends the flight.
            self._start_anew()
        if self.phase is Phase.CONNECT:
            return self._connect(now, view)
        if self.phase is Phase.PREPARE:
            return self._prepare(now, view)
        return self._land(now, view) if self.phase is Phase.LAND else []

    def _land(self, now: int, view: View) -> list[Message]:
        """Told once: an autopilot that lands and then does something else was told so by somebody. And not
        unheard: a pilot may have it."""
        vehicle, profile = self.vehicle, self.profile
        if vehicle.heartbeat is not None and not vehicle.armed:
            return self._leave(now, view) if vehicle.beat_at - self._arming > _ARMS else []
        if not vehicle.alive:
            return []
        if profile is not None and vehicle.flies:
            # Without set-points it may hold until it is told.
            before = profile.loss_modes | {profile.guided_custom_mode}
            if self._passage.strays(vehicle.mode, profile.land_modes, before):
                self._yield()
                return []
        if self._passage.entered:
            return []
        return self._commands.call(now, NAV_LAND, (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, 0.0))

    def _leave(self, now: int, view: View) -> list[Message]:
        """Disarmed. PX4 is then in the mode in which it was steered, where its checks before the next flight
        fail: it is asked for another one, unless somebody has chosen one already."""
        vehicle, profile = self.vehicle, self.profile
        if self._landed_at is None:
            self._landed_at = now
            self._commands.forget()
            doubt, returning = vehicle.positioning.radius, self._returning
            self.landing = landed(self._config, self.start, view.own, doubt, returning=returning)
        if profile is not None and profile.streams_first and now - self._landed_at <= _LEAVES:
            if not vehicle.alive:
                return []
            if vehicle.mode in profile.land_modes | {profile.guided_custom_mode}:
                return self._commands.call(now, DO_SET_MODE, profile.hold_call)
        self.phase = Phase.DONE
        return []

    def _yield(self) -> None:
        """Somebody has it."""
        self._owner, self.phase = Owner.OURS, Phase.YIELDED
        self._commands.forget()

    def _keep(self, now: int) -> None:
        """See whose the vehicle is. Somebody who took it over keeps it: nothing is ordered against them."""
        before, self._owner = self._owner, self._authority.owner(now)
        if self._owner is Owner.TAKEN:
            self._yield()
        elif self._owner is Owner.LOST and before is not Owner.LOST:
            self._commands.forget()

    def _ask_back(self, now: int) -> list[Message]:
        """For the mode that nobody but the time-out has ended."""
        if self.profile is None:
            return []
        return self._commands.call(now, DO_SET_MODE, self.profile.mode_call)

    def _start_anew(self) -> None:
        """As at the beginning: a new go is needed."""
        self.phase, self._owner, self._settling_since = Phase.CONNECT, Owner.OURS, None
        self._returning = False
        self._height = None
        self._commands.forget()
        self._readiness.forget()

    def _settle(self, now: int, view: View) -> None:
        """Land without settling when that cannot go on: blind, or too long."""
        since = self._settling_since = now if self._settling_since is None else self._settling_since
        blind = view.own is None or view.own.age > self._config.guard.own_stale_us
        if blind or now - since > self._config.guard.settle_us:
            self._alight()

    def _connect(self, now: int, view: View) -> list[Message]:
        self.waiting_for = self._readiness.missing(view, go=self._height is not None)
        self._expire(now)
        calls = self._readiness.requests(now)
        if not self.waiting_for and view.own is not None and view.local is not None:
            self._takeoff.begin(view.own)
            self._passage = Passage(self.vehicle.mode)
            self.phase = Phase.PREPARE
        return calls

    def _expire(self, now: int) -> None:
        """A go that has not armed the vehicle yet does not keep for ever."""
        if self._height is None:
            return
        self._go_at = now if self._go_at is None else self._go_at
        if now - self._go_at > self._config.guard.go_keeps_us:
            self._start_anew()

    def _prepare(self, now: int, view: View) -> list[Message]:
        profile, height, takeoff = self.profile, self._height, self._takeoff
        if profile is None or height is None:
            return []
        if takeoff.disarmed(profile):
            self._start_anew()
            return []
        if not self.vehicle.armed:
            self._expire(now)
        if not self.vehicle.alive:
            # Who has it nobody knows: the next heartbeat says, before anything is asked of it.
            return []
        ways = profile.takeoff_modes | {profile.guided_custom_mode}
        if view.own is not None and takeoff.risen(view.own, height):
            ways |= {profile.hold_mode}
        if self._passage.strays(self.vehicle.mode, ways):
            self._yield()
            if not self.vehicle.armed:
                self._start_anew()
        elif self.vehicle.flies and view.own_age > self._config.guard.own_lost_us:
            # It would never be seen to have arrived.
            self._alight()
        if self.phase is not Phase.PREPARE or view.own is None:
            return []
        step = takeoff.step(profile)
        sent = takeoff.advance(now, profile, view.own, height, self._floor(view))
        if takeoff.step(profile) is None:
            self.phase = Phase.ESCORT
            self._authority.begin()
        elif step is not None and takeoff.step(profile) is step:
            self.waiting_for = step.value
        return sent
