"""Flight state machine: connect → arm → take-off → escort → settle → land, by MAVLink commands.

Each command is repeated until it is acknowledged. Nothing starts without an operator's go (a NAV_TAKEOFF
addressed to the companion), which expires if it has not armed the vehicle in time. Set-points are sent only
in guided mode, in which the autopilot follows them, or to enter it: at the start where the autopilot requires
a stream, and after a time-out has ended the mode. Another controller that takes the vehicle over by a change
of mode, also during take-off and landing, keeps it until a new go is given.
"""

from __future__ import annotations

from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig
from companion.flight.command_protocol import Commands
from companion.flight.control_authority import ControlAuthority, Owner
from companion.flight.descent import Descent
from companion.flight.go import Go
from companion.flight.landing import Landing
from companion.flight.planned_limits import PlannedLimits
from companion.flight.readiness import Readiness
from companion.flight.takeoff import Takeoff
from companion.flight.vehicle import Vehicle
from companion.values.horizon import Array
from companion.values.phase import STEERED, Phase
from companion.values.stance import Stance
from companion.world import View
from mavlink_bridge.messages import CommandAck, Message, ParamValue, Source


class Pilot:
    """Flight of one vehicle, as a state machine driven by the received messages.

    It sends commands, never set-points. ``origin_altitude``: altitude of the fleet frame's zero, m above mean
    sea level. ``slow``: the autopilot's messages are requested at low rates. ``commands``: the commands sent
    to the autopilot, with its refusals. ``limits``: limits of the autopilot; ``planned``: limits for plans.
    """

    def __init__(
        self, config: CompanionConfig, own: Source, origin_altitude: float, *, slow: bool = False
    ) -> None:
        self._config = config
        self.phase = Phase.CONNECT
        self.vehicle = Vehicle()
        self.waiting_for = "a heartbeat of the autopilot"
        self.column_waits = ""
        """What the autopilot must wait for before it takes off or lands; an empty string: nothing."""
        self._ready = self._returning = False
        self._go = Go(config.guard.go_keeps_us)
        self.commands = Commands(own)
        self._readiness = Readiness(config, self.vehicle, self.commands, slow=slow)
        self.limits = self._readiness.limits
        self._takeoff = Takeoff(self.vehicle, self.commands, origin_altitude)
        self._authority = ControlAuthority(self.vehicle, self.commands)
        self._descent = Descent(config, self.vehicle, self.commands)
        self.planned = PlannedLimits(config, self.limits, self._takeoff)

    @property
    def stance(self) -> Stance:
        """Stance of the vehicle to its column of air."""
        if self.phase is Phase.SETTLE and self._descent.clear:
            return Stance.LOWERS
        if self.phase is Phase.CONNECT and self.vehicle.alive and not self.vehicle.flies:
            return Stance.JOINS if self._ready else Stance.PARKED
        climbs = self.phase is Phase.PREPARE and not self._takeoff.began_in_flight
        return Stance.CLIMBS if climbs else Stance.FREE

    @property
    def guided(self) -> bool:
        """Whether the autopilot follows set-points now."""
        return self.vehicle.guided

    @property
    def start(self) -> Array | None:
        """Position (3,) m, fleet-local ENU, at the last take-off or take-over; None before the first."""
        return self._takeoff.start

    @property
    def landing(self) -> Landing | None:
        """The last landing; None before the first."""
        return self._descent.landing

    @property
    def planned_limits(self) -> LimitsConfig:
        """Limits that plans keep."""
        return self.planned.lowered.limits

    def steers(self, now: int) -> bool:
        """Return whether the autopilot follows set-points, or has just accepted the guided mode."""
        if self.guided or self.phase is not Phase.PREPARE or not self.streaming:
            return self.guided
        return self._takeoff.mode_accepted(now)

    @property
    def streaming(self) -> bool:
        """Whether set-points are to be sent."""
        if self.phase in STEERED:
            return self.guided or self._authority.owner is Owner.LOST
        return self.phase is Phase.PREPARE and self._takeoff.streams

    def receive(self, message: Message) -> None:
        """Receive a message of the own autopilot."""
        if isinstance(message, CommandAck):
            self.commands.receive(message)
            self._readiness.receive(message)
        elif isinstance(message, ParamValue):
            self.limits.receive(message)
        else:
            self.vehicle.receive(message)

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
        if self.phase is Phase.PREPARE and self._go.height not in (None, height):
            # The autopilot may have received the other height already.
            return False
        if self.phase is Phase.CONNECT and self.limits.refuses:
            return False
        if self.phase is Phase.YIELDED:
            self._start_anew()
        self._go.give(height)
        return True

    def take_back(self) -> None:
        """Cancel a go that waits for its conditions; a take-off that has begun continues."""
        if self.phase is Phase.CONNECT:
            self._go.cancel()

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
            waited = self._go.cancel()
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

    def returned(self) -> None:
        """Report that the returning vehicle is at its start: it settles and lands."""
        if self.phase is Phase.RETURN:
            self.phase = Phase.SETTLE

    def settled(self) -> None:
        """Report that the vehicle hovers clear of the others: it lands once its column is reserved."""
        if self.phase is Phase.SETTLE:
            self._descent.clear = True
            if not self.column_waits:
                self._begin_landing()

    def _begin_landing(self) -> None:
        self.phase = Phase.LAND
        self._descent.begin(self.start, self._takeoff.asked_to_arm, returning=self._returning)

    def step(self, now: int, view: View) -> list[Message]:
        """Return the commands to send at ``now`` (µs)."""
        self.vehicle.tick(now)
        commands = self._act(now, view)
        if self.phase in STEERED:
            commands += self._readiness.confirm_origin(now, view)
        connected = self.phase is not Phase.CONNECT or self._readiness.received
        return [*commands, *self._readiness.wishes(now)] if connected else commands

    def _act(self, now: int, view: View) -> list[Message]:
        if self.phase in STEERED and self._authority.update(now) is Owner.TAKEN:
            # No commands are sent against another controller.
            self._yield()
        if self.phase is Phase.SETTLE and self._descent.due(now, view.own, reserved=not self.column_waits):
            self._begin_landing()
        if self.phase in STEERED:
            return self._authority.requests(now)
        self._authority.release()
        if self.phase is Phase.YIELDED and self.vehicle.alive and not self.vehicle.armed:
            # Disarming by another controller ends the flight.
            self._start_anew()
        if self.phase is Phase.CONNECT:
            return self._connect(now, view)
        if self.phase is Phase.PREPARE:
            return self._prepare(now, view)
        return self._land(now, view) if self.phase is Phase.LAND else []

    def _land(self, now: int, view: View) -> list[Message]:
        """Return the commands of the landing; end the flight, or yield to another controller."""
        if self._descent.strays():
            self._yield()
            return []
        sent = self._descent.step(now, view.own)
        if self._descent.over:
            self.phase = Phase.DONE
        return sent

    def _yield(self) -> None:
        """Leave the vehicle to another controller."""
        self.phase = Phase.YIELDED
        self.commands.forget()

    def _start_anew(self) -> None:
        """Restart from the beginning: a new go is needed."""
        self.phase = Phase.CONNECT
        self._returning = self._ready = False
        self._go.cancel()
        self._descent.forget()
        self.commands.forget()
        self._readiness.forget()

    def _connect(self, now: int, view: View) -> list[Message]:
        if self._go.expired(now):
            self._start_anew()
        self.waiting_for = self._readiness.missing(view, go=self._go.height is not None)
        calls = self._readiness.requests(now)
        self._ready = not self.waiting_for
        if self._ready and not self.vehicle.flies:
            # The autopilot may disarm a vehicle that waits with its motors on.
            self.waiting_for = self.column_waits
        if not self.waiting_for and view.own is not None and view.local is not None:
            self._takeoff.begin(view.own)
            self.phase = Phase.PREPARE
        return calls

    def _prepare(self, now: int, view: View) -> list[Message]:
        profile, height, takeoff = self.vehicle.profile, self._go.height, self._takeoff
        if profile is None or height is None:
            return []
        if takeoff.disarmed(profile):
            self._start_anew()
            return []
        if not self.vehicle.armed and self._go.expired(now):
            self._start_anew()
        if not self.vehicle.alive:
            # The owner is unknown until the next heartbeat; no commands are sent before it.
            return []
        if takeoff.strays(profile, view.own, height):
            self._yield()
            if not self.vehicle.armed:
                self._start_anew()
        elif self.vehicle.flies and view.own_age > self._config.guard.own_lost_us:
            # Without an own position the end of the climb would never be detected.
            self._begin_landing()
        if self.phase is not Phase.PREPARE or view.own is None:
            return []
        floor = self.planned.escort_floor(view)
        sent = takeoff.advance(now, profile, view.own, height, floor, self.column_waits)
        self.waiting_for = takeoff.waiting_for
        if takeoff.step(profile) is None:
            self.phase = Phase.ESCORT
            self._authority.begin()
        return sent
