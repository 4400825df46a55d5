"""Flight state machine: connect → arm → take-off → escort → settle → land, by MAVLink commands.

Each command is repeated until it is acknowledged. Nothing starts without an operator's go (a NAV_TAKEOFF
addressed to the companion), which expires if it has not armed the vehicle in time. Set-points are sent only
in guided mode, in which the autopilot follows them, or to enter it: at the start where the autopilot requires
a stream, and after a time-out has ended the mode. Another controller that takes the vehicle over by a change
of mode, also during take-off and landing, keeps it until a new go is given.
"""

from __future__ import annotations

from math import inf

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig
from companion.flight.autopilot_limits import AutopilotLimits
from companion.flight.autopilots import Loop, Profile, Step
from companion.flight.command_protocol import Commands
from companion.flight.control_authority import ControlAuthority, Owner, Passage
from companion.flight.landing import Landing, landed
from companion.flight.lowering import Lowered
from companion.flight.readiness import Readiness
from companion.flight.takeoff import Takeoff
from companion.flight.vehicle import Vehicle
from companion.values.horizon import Array
from companion.values.phase import STEERED, Phase
from companion.values.stance import Stance
from companion.world import View
from mavlink_bridge.messages import CommandAck, Message, ParamValue, Source

_NAN = float("nan")
_ARM_REPORT_US = 2_000_000
"""µs after the last arm command during which a heartbeat may still report the vehicle as disarmed."""
_MODE_REPORT_US = 1_500_000
"""µs after the transmission of an accepted mode command; so long the mode is assumed without a heartbeat."""
_LANDED_US = 2_500_000
"""µs for which the vehicle is disarmed and on the ground before it has landed: more than two heartbeats."""
_LEAVE_TIMEOUT_US = 5_000_000
"""µs after landing during which the hold mode is requested."""


class Pilot:
    """Flight of one vehicle, as a state machine driven by the received messages.

    It sends commands, never set-points. ``origin_altitude``: altitude of the fleet frame's zero, m above mean
    sea level.
    """

    def __init__(self, config: CompanionConfig, own: Source, origin_altitude: float) -> None:
        self._config = config
        self.phase = Phase.CONNECT
        self.vehicle = Vehicle()
        self.waiting_for = "a heartbeat of the autopilot"
        self.column_waits = ""
        """What the autopilot must wait for before it takes off or lands; an empty string: nothing."""
        self._ready = self._clear_to_land = False
        self._settling_since: int | None = None
        self._landed_at: int | None = None
        self._returning = False
        self.landing: Landing | None = None
        """The last landing; None before the first."""
        self._height: float | None = None
        self._go_at: int | None = None
        self._passage = Passage(0)
        self._commands = Commands(own)
        self._readiness = Readiness(config, self.vehicle, self._commands)
        self._authority = ControlAuthority(self.vehicle)
        self._owner = Owner.OURS
        self._arming = 0
        self._takeoff = Takeoff(self.vehicle, self._commands, origin_altitude)
        self._above_floor = self.limits.lowered
        self._floor_of: tuple[Lowered, float] | None = None

    @property
    def profile(self) -> Profile | None:
        """Profile of the autopilot, None for an unknown one."""
        return self.vehicle.profile

    @property
    def stance(self) -> Stance:
        """Stance of the vehicle to its column of air."""
        if self.phase is Phase.SETTLE and self._clear_to_land:
            return Stance.LOWERS
        if self.phase is Phase.CONNECT and self.vehicle.alive and not self.vehicle.flies:
            return Stance.JOINS if self._ready else Stance.PARKED
        climbs = self.phase is Phase.PREPARE and not self._takeoff.began_in_flight
        return Stance.CLIMBS if climbs else Stance.FREE

    @property
    def limits(self) -> AutopilotLimits:
        """Limits of the autopilot."""
        return self._readiness.limits

    @property
    def loop(self) -> Loop | None:
        """Loop gains of the autopilot, None for an unknown one."""
        profile = self.profile
        return self.limits.lowered.loop or (None if profile is None else profile.loop)

    @property
    def said(self) -> str:
        """Text of the autopilot's last warning."""
        return self.vehicle.said

    @property
    def refusals(self) -> list[str]:
        """Descriptions of the last refused commands."""
        return list(self._commands.refusals)

    @property
    def refused(self) -> int:
        """Number of refused commands."""
        return self._commands.refused

    @property
    def guided(self) -> bool:
        """Whether the autopilot follows set-points now."""
        return self.vehicle.guided

    def steers(self, now: int) -> bool:
        """Return whether the autopilot follows set-points, or has just accepted the guided mode.

        PX4 reports the mode in its next heartbeat, up to a second later.
        """
        profile = self.profile
        if self.guided or profile is None or self.phase is not Phase.PREPARE or not self.streaming:
            return self.guided
        return self._commands.taken(now, mavlink.MAV_CMD_DO_SET_MODE, profile.mode_call, _MODE_REPORT_US)

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
        """Receive a message of the own autopilot."""
        if isinstance(message, CommandAck):
            self._commands.receive(message)
            self._readiness.receive(message)
        elif isinstance(message, ParamValue):
            self.limits.receive(message)
        else:
            self.vehicle.receive(message)

    def _floor(self, view: View) -> float:
        """Return the height (m, fleet-local) above which an escort may begin during the climb.

        It is ∞ for a task other than the escort; without a target, because the vehicle would stay there; and
        in certified mode, because committed plans begin at rest.
        """
        config = self._config
        if config.task != "escort" or config.avoidance == "certified" or view.target is None:
            return inf
        return self.planned_limits.within(config.field.margin(1)).box_min[2]

    def go(self, height: float) -> bool:
        """Accept the operator's go: climb to ``height`` (m) above the start; return whether it is accepted.

        A vehicle that flies already is taken over where it is. In escort, hold and return the escort
        continues, whatever the height. In all other phases the go is refused for a height outside 0.5…120 m,
        during settling, during landing and after it, during take-off for another height, and before take-off
        if the autopilot's parameters do not permit an escort.
        """
        if self.phase in (Phase.HOLD, Phase.RETURN, Phase.ESCORT):
            self.phase, self._returning = Phase.ESCORT, False
            return True
        if self.phase not in (Phase.CONNECT, Phase.PREPARE, Phase.YIELDED) or not 0.5 <= height <= 120.0:
            return False
        if self.phase is Phase.PREPARE and self._height not in (None, height):
            # The autopilot may have received the other height already.
            return False
        if self.phase is Phase.CONNECT and self.limits.refuses:
            return False
        if self.phase is Phase.YIELDED:
            self._start_anew()
        self._height, self._go_at = height, None
        return True

    def take_back(self) -> None:
        """Cancel a go that waits for its conditions; a take-off that has begun continues."""
        if self.phase is Phase.CONNECT:
            self._height = None

    def hold(self) -> bool:
        """Hold the position, by order of the operator; return whether the order is accepted."""
        if self.phase in (Phase.ESCORT, Phase.RETURN):
            self.phase, self._returning = Phase.HOLD, False
        return self.phase is Phase.HOLD

    def come_back(self) -> bool:
        """Return to the start and land there, by order of the operator; return whether it is accepted.

        During settling and landing the order is accepted but has no effect.
        """
        if self.phase in (Phase.ESCORT, Phase.HOLD):
            self.phase, self._returning = Phase.RETURN, True
        return self.phase in (Phase.RETURN, Phase.SETTLE, Phase.LAND)

    def streamed(self, now: int) -> None:
        """Record that a set-point is sent at ``now`` (µs)."""
        self._authority.streamed(now)

    @property
    def start(self) -> Array | None:
        """Position (3,) m, fleet-local ENU, at the last take-off or take-over; None before the first."""
        return self._takeoff.start

    def land(self) -> bool:
        """Land, by order of the operator; return whether the order is accepted.

        A vehicle under way first comes to a hover clear of the others, because an autopilot that lands does
        not avoid other vehicles. The order is refused if another controller has the vehicle, or if, before
        the take-off, the vehicle flies in a mode that is neither the guided nor the hold mode. If the
        autopilot is silent before the take-off, the order only cancels a waiting go, and is refused without
        one.
        """
        if self.phase in STEERED:
            # A vehicle that is still on its way back lands where it is: this landing is not a return.
            self._returning = self._returning and self.phase is not Phase.RETURN
            self.phase = Phase.SETTLE
        elif self.phase is Phase.PREPARE:
            self._begin_landing()
        elif self.phase is Phase.CONNECT:
            waited = self._height is not None
            self.take_back()
            if not self.vehicle.alive:
                # It is unknown whether the vehicle flies, and which controller has it.
                return waited
            if self.vehicle.flies:
                if not self.vehicle.left_by_us:
                    return False
                self._begin_landing()
        return self.phase is not Phase.YIELDED

    def alight(self) -> None:
        """Settle and then land, because of a severe fault.

        This has no effect on the ground, during take-off, and if another controller has the vehicle.
        """
        if self.phase in STEERED:
            self.phase = Phase.SETTLE

    @property
    def planned_limits(self) -> LimitsConfig:
        """Limits for plans, see ``lowered``."""
        return self.lowered.limits

    @property
    def lowered(self) -> Lowered:
        """Limits for plans: the configured ones, lowered to what the autopilot can follow.

        With ``guard.least_height`` the box's floor is at least so high above the place of the take-off. It is
        not for a vehicle that was taken over in flight, whose take-off is not known. The same object is
        returned as long as nothing changes.
        """
        lowered, start, least = self.limits.lowered, self.start, self._config.guard.least_height
        if least is None or start is None or self._takeoff.began_in_flight:
            return lowered
        of = lowered, float(start[2]) + least
        if self._floor_of != of:
            self._floor_of, self._above_floor = of, _above(*of)
        return self._above_floor

    def returned(self) -> None:
        """Report that the returning vehicle is at its start: it settles and lands."""
        if self.phase is Phase.RETURN:
            self.phase = Phase.SETTLE

    def settled(self) -> None:
        """Report that the vehicle hovers clear of the others: it lands once its column is reserved."""
        if self.phase is Phase.SETTLE:
            self._clear_to_land = True
            if not self.column_waits:
                self._begin_landing()

    def _begin_landing(self) -> None:
        self.phase, self._landed_at, self._clear_to_land = Phase.LAND, None, False
        self._arming = self._takeoff.asked_to_arm
        self._commands.forget()
        self._passage = Passage(self.vehicle.mode)

    def step(self, now: int, view: View) -> list[Message]:
        """Return the commands to send at ``now`` (µs)."""
        self.vehicle.tick(now)
        commands = self._act(now, view)
        if self.phase in STEERED:
            commands += self._readiness.confirm_origin(now, view)
        connected = self.phase is not Phase.CONNECT or self._readiness.received
        return [*commands, *self._readiness.wishes(now)] if connected else commands

    def _act(self, now: int, view: View) -> list[Message]:
        if self.phase in STEERED:
            self._update_owner(now)
        if self.phase is Phase.SETTLE:
            self._settle(now, view)
        if self.phase not in STEERED:
            # The guided mode is not requested any more; otherwise a vehicle that has lost this mode would
            # never land.
            self._owner = Owner.OURS
        if self._owner is Owner.LOST:
            return self._request_guided_mode(now)
        if self.phase is Phase.YIELDED and self.vehicle.alive and not self.vehicle.armed:
            # Disarming by another controller ends the flight.
            self._start_anew()
        if self.phase is Phase.CONNECT:
            return self._connect(now, view)
        if self.phase is Phase.PREPARE:
            return self._prepare(now, view)
        return self._land(now, view) if self.phase is Phase.LAND else []

    def _land(self, now: int, view: View) -> list[Message]:
        """Return the landing command until it takes effect; after the landing, what ``_leave`` returns.

        The vehicle has landed when its autopilot has said for ``_LANDED_US``, and nothing else, that it is
        disarmed and on the ground: a single message may be another sender's. Without any report of the landed
        state it must be disarmed for 10 s (``Vehicle.rested_for``).
        The command is not repeated after it took effect: if the autopilot then leaves its landing mode,
        another controller has ordered that. The command is not sent while the autopilot is silent, because a
        pilot may have the vehicle.
        """
        vehicle, profile = self.vehicle, self.profile
        if vehicle.heartbeat is not None and not vehicle.armed:
            reported = vehicle.beat_at - self._arming > _ARM_REPORT_US
            return self._leave(now, view) if reported and self._rests() else []
        if not vehicle.alive:
            return []
        if profile is not None and vehicle.flies:
            # Without set-points the autopilot may hold its position until the command arrives.
            before = profile.loss_modes | {profile.guided_custom_mode}
            if self._passage.strays(vehicle.mode, profile.land_modes, before):
                self._yield()
                return []
        if self._passage.entered:
            return []
        return self._commands.call(now, mavlink.MAV_CMD_NAV_LAND, (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, 0.0))

    def _rests(self) -> bool:
        """Return whether the vehicle has landed."""
        return self._landed_at is not None or self.vehicle.rested_for >= _LANDED_US

    def _leave(self, now: int, view: View) -> list[Message]:
        """Return the mode command after disarming, and end the flight.

        PX4 may remain in guided mode, where its checks before the next flight fail. So in guided and landing
        modes the hold mode is requested for up to 5 s.
        """
        vehicle, profile = self.vehicle, self.profile
        if self._landed_at is None:
            self._landed_at = now
            self._commands.forget()
            doubt, returning = vehicle.positioning.radius, self._returning
            self.landing = landed(self._config, self.start, view.own, doubt, returning=returning)
        if profile is not None and profile.streams_first and now - self._landed_at <= _LEAVE_TIMEOUT_US:
            if not vehicle.alive:
                return []
            if vehicle.mode in profile.land_modes | {profile.guided_custom_mode}:
                return self._commands.call(now, mavlink.MAV_CMD_DO_SET_MODE, profile.hold_call)
        self.phase = Phase.DONE
        return []

    def _yield(self) -> None:
        """Leave the vehicle to another controller."""
        self._owner, self.phase = Owner.OURS, Phase.YIELDED
        self._commands.forget()

    def _update_owner(self, now: int) -> None:
        """Update the owner; if another controller has taken the vehicle over, yield to it.

        No commands are sent against that controller.
        """
        before, self._owner = self._owner, self._authority.owner(now)
        if self._owner is Owner.TAKEN:
            self._yield()
        elif self._owner is Owner.LOST and before is not Owner.LOST:
            self._commands.forget()

    def _request_guided_mode(self, now: int) -> list[Message]:
        """Return the request for the guided mode, which the autopilot's time-out has ended."""
        if self.profile is None:
            return []
        return self._commands.call(now, mavlink.MAV_CMD_DO_SET_MODE, self.profile.mode_call)

    def _start_anew(self) -> None:
        """Restart from the beginning: a new go is needed."""
        self.phase, self._owner, self._settling_since = Phase.CONNECT, Owner.OURS, None
        self._returning = self._ready = self._clear_to_land = False
        self._height = None
        self._commands.forget()
        self._readiness.forget()

    def _settle(self, now: int, view: View) -> None:
        """Land if the column is reserved, the own position is stale or the time limit is exceeded.

        The last two do not wait for a reservation.
        """
        since = self._settling_since = now if self._settling_since is None else self._settling_since
        blind = view.own is None or view.own.age > self._config.guard.own_stale_us
        reserved = self._clear_to_land and not self.column_waits
        if reserved or blind or now - since > self._config.guard.settle_us:
            self._begin_landing()

    def _connect(self, now: int, view: View) -> list[Message]:
        self._expire_go(now)
        self.waiting_for = self._readiness.missing(view, go=self._height is not None)
        calls = self._readiness.requests(now)
        self._ready = not self.waiting_for
        if self._ready and not self.vehicle.flies:
            # The autopilot may disarm a vehicle that waits with its motors on.
            self.waiting_for = self.column_waits
        if not self.waiting_for and view.own is not None and view.local is not None:
            self._takeoff.begin(view.own)
            self._passage = Passage(self.vehicle.mode)
            self.phase = Phase.PREPARE
        return calls

    def _expire_go(self, now: int) -> None:
        """Cancel a go that has not armed the vehicle within ``guard.go_keeps_us``."""
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
            self._expire_go(now)
        if not self.vehicle.alive:
            # The owner is unknown until the next heartbeat; no commands are sent before it.
            return []
        ways = profile.takeoff_modes | {profile.guided_custom_mode}
        if view.own is not None and takeoff.risen(view.own, height):
            ways |= {profile.hold_mode}
        if self._passage.strays(self.vehicle.mode, ways):
            self._yield()
            if not self.vehicle.armed:
                self._start_anew()
        elif self.vehicle.flies and view.own_age > self._config.guard.own_lost_us:
            # Without an own position the end of the climb would never be detected.
            self._begin_landing()
        if self.phase is not Phase.PREPARE or view.own is None:
            return []
        step = takeoff.step(profile)
        climbs = not self.column_waits
        sent = takeoff.advance(now, profile, view.own, height, self._floor(view), climbs=climbs)
        if takeoff.step(profile) is None:
            self.phase = Phase.ESCORT
            self._authority.begin()
        elif step is not None and takeoff.step(profile) is step:
            self.waiting_for = step.value if climbs or step is not Step.TAKEOFF else self.column_waits
        return sent


def _above(lowered: Lowered, floor: float) -> Lowered:
    """Return ``lowered`` with a box whose floor is at ``floor`` (m) at least, or at three quarters of it."""
    low, high = lowered.limits.box_min, lowered.limits.box_max
    raised = max(low[2], min(floor, low[2] + 0.75 * (high[2] - low[2])))
    return lowered._replace(limits=lowered.limits.model_copy(update={"box_min": (*low[:2], raised)}))
