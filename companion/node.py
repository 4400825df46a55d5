"""The companion computer: receive → world → plan → guard → set-point → bytes. No socket, no clock."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from math import hypot
from typing import ClassVar, NamedTuple

import numpy as np

from companion.aims import Aims
from companion.certified.flight import CertifiedFlight
from companion.certified.keeper import Why
from companion.config import CompanionConfig, MethodName
from companion.dials import Dials
from companion.errors import CompanionError, SurfaceError
from companion.forces import Obstacles
from companion.guard import Guard
from companion.heading import Heading
from companion.horizon import Array, Horizon, Motion
from companion.orders import Orders
from companion.pilot import Phase, Pilot
from companion.plan_log import PlanLog
from companion.planner import Aim, Plan, Planner
from companion.reactions import Reactions
from companion.reception import LINKS, accepts
from companion.setpoint import is_finite, setpoint
from companion.sharing import Sharing
from companion.voice import Voice
from companion.watch import Situation, Watch
from companion.world import View, World
from mavlink_bridge.codec import Codec, Counters
from mavlink_bridge.frames import FleetFrame, LocalFrame
from mavlink_bridge.messages import Message, Source, Timesync, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.signing import Signing

COMPONENT = 195
"""MAV_COMP_ID_PATHPLANNER."""
_LONGEST_NS = (1 << 32) - 1
_LOOK = 100_000
"""µs between two looks at what may be wrong."""
_NOTHING: dict[str, list[Message]] = {"autopilot": [], "ground": []}
_ZERO = np.zeros(3)
_ZERO.flags.writeable = False


class Tally(NamedTuple):
    """What a companion counted so far; ``plan_ns`` holds one stopwatch reading per plan, at most 4.29 s, and
    ``plan_at`` when that plan was due (µs on its clock)."""

    plans: int
    relaxed: int
    solver_failures: int
    held: int
    anchored_anew: int
    plan_ns: Sequence[int]
    plan_at: Sequence[int] = ()


class Companion:
    """One vehicle's companion, a ``Node``. Links: ``autopilot``, ``swarm``, ``target``, ``ground``.

    ``stopwatch`` (ns) only measures how long planning takes; nothing depends on it. ``signing``: its own, for
    all links, whose number in ``LINKS`` is the link id; without, whatever it hears counts.
    """

    pilots: ClassVar[type[Pilot]] = Pilot

    def __init__(
        self,
        config: CompanionConfig,
        system: int,
        target_system: int,
        fleet: FleetFrame,
        stopwatch: Callable[[], int],
        signing: Signing | None = None,
    ) -> None:
        self.config = config
        self.name = f"companion-{system}"
        self._source = Source(system, COMPONENT)
        self._stopwatch = stopwatch
        self.world = World(config, system, target_system, fleet)
        self.planner = Planner(config)
        self.guard = Guard(config)
        self.pilot = self.pilots(config, self._source, fleet.altitude)
        self._sharing = Sharing(config, self._source, fleet)
        self.voice = Voice(config.voice, self._source)
        self._dials = Dials(config, self._source)
        self._signing = signing
        neighbours = self.world.neighbours
        self._earshot = neighbours.earshot
        self._codecs = {
            link: Codec(accepts(link, system, target_system, config, neighbours.ignores), signing, number)
            for number, link in enumerate(LINKS)
        }
        self.plan: Plan | None = None
        self._frame: LocalFrame | None = None
        self.watch = Watch(config)
        self._reactions = Reactions()
        self._next_look = self._looked_late = 0
        self._certified = (
            CertifiedFlight(config, self._source, fleet) if config.avoidance == "certified" else None
        )
        ahead = (config.horizon.steps + 1) * config.horizon.dt_us * 1e-6
        certified = self._certified
        self._aims = Aims(config, system, self.pilot, ahead if certified is None else certified.seconds)
        self._orders = Orders(config, self._source, fleet, self.pilot, self._aims)
        self._obstacles = Obstacles((), np.empty((0, 1, 3)), np.empty(0), np.empty(0))
        self._heading = Heading(config.heading, config.horizon)
        self._boot: int | None = None
        self._next_plan = self._next_setpoint = 0
        self._fastest = hypot(*config.limits.v_max)
        self._flown = 0
        self._plans = self._relaxed = 0
        self._plan_ns = array("I")
        self._plan_at = array("q")
        self.plan_log = PlanLog()
        self.not_finite = 0
        """Set-points that were none, and were not sent."""

    @property
    def tally(self) -> Tally:
        """Counters for the summary."""
        failures, anchored = self.guard.failures, self.guard.anchored_anew
        if self._certified is not None:
            keeper = self._certified.keeper
            failures, anchored = keeper.held[Why.UNSOLVED], keeper.anchored_anew
        return Tally(
            self._plans, self._relaxed, failures, self.held, anchored, self._plan_ns[:], self._plan_at[:]
        )

    @property
    def held(self) -> int:
        """How often an old plan was kept."""
        certified = self._certified
        return self.guard.held if certified is None else sum(certified.keeper.held.values())

    @property
    def flown(self) -> Horizon | None:
        """What it flies; None while it steers nothing."""
        return self.guard.horizon

    @property
    def last_spent(self) -> int | None:
        """The stopwatch's reading (ns) of the last plan."""
        return self._plan_ns[-1] if self._plan_ns else None

    def use(self, methods: tuple[MethodName, ...]) -> None:
        """From the next plan on."""
        self.planner.use(methods)
        self._earshot.use(methods)

    def shed(self) -> Sequence[int]:
        """Take the stopwatch's readings (ns) away, and the plan log with them: for who runs for days."""
        taken, self._plan_ns = self._plan_ns, array("I")
        self._plan_at = array("q")
        self.plan_log = PlanLog()
        return taken

    @property
    def system(self) -> int:
        """The vehicle's system id, and its own."""
        return self._source.system

    @property
    def counters(self) -> Mapping[str, Counters]:
        """What became of the bytes of each link."""
        return {link: codec.counters for link, codec in self._codecs.items()}

    @property
    def bad_frames(self) -> int:
        """Frames that no link's codec could make sense of."""
        return sum(codec.counters.bad for codec in self._codecs.values())

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Handle what arrived and do what is due at ``now`` (µs)."""
        if self._boot is None:
            self._boot = self._next_plan = self._next_setpoint = self._next_look = now
        if self._signing is not None:
            self._signing.present(now)
        answers = self._receive(now, inbox)
        if not self._has_to_act(now):
            return self._encode(ground=answers)
        view = self.world.at(now)
        commands = self.pilot.step(now, view)
        self._look(now, view)
        self._aims.forget(view)
        self._fly(now, view)
        setpoints = self._setpoints(now, view)
        certified = self._certified
        shared = self._sharing.due(now, view, self.guard.horizon if certified is None else None)
        leaving = self.pilot.phase in (Phase.LAND, Phase.DONE)
        told = [] if certified is None else certified.messages(now, farewell=leaving)
        said = self._said(now)
        return self._encode(
            autopilot=[*commands, *setpoints, *shared.autopilot, *said["autopilot"]],
            swarm=shared.swarm + told,
            ground=[*answers, *said["ground"]],
        )

    def _said(self, now: int) -> dict[str, list[Message]]:
        """What the ground is told, by link: events and figures."""
        if not (self.config.voice.texts or self.config.voice.values):
            return _NOTHING
        self.world.say(now, self.voice)
        said: list[Message] = [*self.voice.due(now)]
        said += self._dials.due(now, self._plan_ns, self.held, self.world.target.age(now))
        return {link: said if link in self.config.voice.links else [] for link in ("autopilot", "ground")}

    def _has_to_act(self, now: int) -> bool:
        """Under way there is nothing to do between two deadlines but to listen."""
        return (
            self.pilot.phase is not Phase.ESCORT
            or (self._certified is not None and not self._certified.idle(now))
            or now >= min(self._next_plan, self._next_setpoint, self._sharing.next_due)
        )

    def _receive(self, now: int, inbox: Sequence[Datagram]) -> list[Message]:
        answers: list[Message] = []
        self._earshot.now = now
        for link, data in inbox:
            for message in self._codecs[link].feed(data, whole=True):
                if link == "ground":
                    answers += self._orders.obey(message)
                    continue
                if link == "autopilot":
                    self.pilot.hear(message)
                if self._certified is not None and link == "swarm" and isinstance(message, Tunnel | Timesync):
                    self._certified.hear(now, message)
                else:
                    self.world.hear(now, link, message)
        return answers

    def _fly(self, now: int, view: View) -> None:
        """Plan when due; start from the measured state each time the vehicle becomes ours."""
        if view.local is not self._frame:
            # Where the vehicle was in the old frame must not be flown to in the new one.
            self._frame, self.guard.horizon = view.local, None
        if self._certified is None and now - self._flown > self.config.guard.hold_us:
            # It hung, and the autopilot did as it saw fit: the old plan leads from where nobody is any more.
            self.guard.horizon = None
        self._flown = now
        if not self.pilot.streaming or view.own is None or view.local is None:
            self.guard.horizon = None
            return
        stale = view.own.age > self.config.guard.own_stale_us
        measured = Motion(view.own.position, self._bounded(view.own.velocity), _ZERO)
        if self.guard.horizon is None:
            if stale or view.yaw is None:
                return
            self._heading.reset(view.yaw)
            if self._aims.goal is None:
                self._aims.goal = view.own.position
            self.guard.start(now, measured)
            if self._certified is not None:
                self._certified.stand(now, measured.position)
        if self._certified is not None:
            self._fly_certified(now, view, measured, self._certified, stale=stale)
            return
        if now < self._next_plan:
            return
        self._next_plan += self.config.rates.replan_us * (
            1 + (now - self._next_plan) // self.config.rates.replan_us
        )
        if stale:
            self.guard.hold(now, solver=False)
            return
        if not self.pilot.guided:
            # Set-points flow before they steer: a plan would run away from the vehicle.
            self.guard.start(now, measured)
            return
        self._plan(now, view, measured)

    def _bounded(self, velocity: Array) -> Array:
        """A measured ``velocity`` (3,) as a plan may begin with it: whatever the own autopilot, or who speaks
        in its name, says of its speed, nothing faster than the limits is asked for."""
        speed = float(np.sqrt(velocity @ velocity))
        return velocity if speed <= self._fastest else velocity * (self._fastest / speed)

    def _fly_certified(
        self, now: int, view: View, measured: Motion, flight: CertifiedFlight, *, stale: bool
    ) -> None:
        """As committed; the next epoch's plan when it is due."""
        if not self.pilot.guided:
            flight.stand(now, measured.position)
        elif not stale:
            flight.watch(now, measured)
        if self.pilot.guided and flight.due(now):
            started = self._stopwatch()
            if self.pilot.phase is Phase.SETTLE:
                here = np.broadcast_to(measured.position, (self.config.horizon.steps + 1, 3))
                self._obstacles = self.world.obstacles(now, view, here)
            aim = None if stale else self._aim(now, view, measured)
            if aim is None:
                flight.keeper.carry_on(Why.MISSING)
            elif flight.lost:
                flight.keeper.anchor(now, measured)
            else:
                self._plans += flight.plan(now, aim, self.world, view)
            self._took(now, started)
        self.guard.horizon = horizon = flight.horizon()
        if horizon is not None and now >= self._next_plan:
            self._next_plan = now + self.config.rates.replan_us
            step, count = self.config.horizon.dt_us, self.config.horizon.steps + 1
            self._face(now, view, horizon.positions(now + step, count, step))

    def _plan(self, now: int, view: View, measured: Motion) -> None:
        aim = self._aim(now, view, measured)
        if aim is None:
            self.guard.hold(now, solver=False)
            return
        horizon, config = self.guard.horizon, self.config.horizon
        state = self.guard.anchor(now, measured)
        started = self._stopwatch()
        try:
            prediction = (
                np.broadcast_to(state.position, (config.steps + 1, 3))
                if horizon is None
                else horizon.positions(now, config.steps + 1, config.dt_us)
            )
            self._obstacles = obstacles = self.world.obstacles(now, view, prediction)
            self.plan = self.planner.plan(now, state.position, state.velocity, prediction, aim, obstacles)
        except CompanionError:
            self.guard.hold(now, solver=True)
            return
        finally:
            self._took(now, started)
        self._plans += 1
        self.plan_log.add(now, self.plan.gradient)
        self._relaxed += self.plan.relaxed
        self.guard.accept(now, self.plan.horizon)
        self._face(now, view, self.plan.horizon.knots[1:, 0:3])

    def _face(self, now: int, view: View, places: Array) -> None:
        """Plan the yaw along the own ``places`` (N + 1, 3) of the next steps; a companion that plans nothing
        keeps its yaw."""
        if view.target is None:
            return
        ahead: Array = 1e-6 * self.config.horizon.dt_us * np.arange(1.0, len(places) + 1.0)
        self._heading.plan(now, places, view.target.ahead(ahead).positions)

    def _took(self, now: int, started: int) -> None:
        """The plan that was due at ``now``, and begun when the stopwatch showed ``started``, is done."""
        self._plan_at.append(now)
        self._plan_ns.append(min(max(self._stopwatch() - started, 0), _LONGEST_NS))

    def _aim(self, now: int, view: View, measured: Motion) -> Aim | None:
        """Where to; None when nobody knows."""
        try:
            aim = self._aims.aim(view, measured, self._obstacles, cautious=self.watch.blinkered)
        except SurfaceError:
            return None
        if self.config.traffic is None:
            return aim
        return aim._replace(destination=self.world.sensed.aside(now, aim.destination, measured.position))

    def _look(self, now: int, view: View) -> None:
        """See what is wrong, ten times a second, and react to what begins."""
        late, self._looked_late = max(self._looked_late, now - self._next_setpoint), 0
        if now < self._next_look:
            self._looked_late = late
            return
        self._next_look = now + _LOOK
        self.world.neighbours.listen(now, view.own)
        situation = Situation(
            now,
            view,
            self.pilot.phase,
            self.pilot.vehicle,
            self.guard.state,
            self.world.neighbours.ages(now),
            self.guard.failing,
            late if self.pilot.streaming else 0,
            self.world.clock_steps,
            self.world.moves,
            self.world.displaced,
        )
        for change in self.watch.look(situation):
            concern = change.concern
            if concern.name != "target":  # of that the world tells
                self.voice.report(concern.severity, concern.text, begins=change.begins)
            self._reactions.note(change)
        self._reactions.follow(self.pilot)

    def _setpoints(self, now: int, view: View) -> list[Message]:
        if now < self._next_setpoint:
            return []
        period = self.config.rates.setpoint_us
        self._next_setpoint += period * (1 + (now - self._next_setpoint) // period)
        horizon, profile = self.guard.horizon, self.pilot.profile
        if not self.pilot.streaming or horizon is None or profile is None or view.local is None:
            return []
        time = now + self.config.setpoint_lead_us
        since_boot = now - (now if self._boot is None else self._boot)
        yaw = self._heading.at(time)
        message = setpoint(time, since_boot, horizon, yaw, view.local, self._source, profile.setpoint_mask)
        if not is_finite(message):
            # Nothing of it may leave: the plan begins anew where the vehicle is measured to be.
            self.not_finite += 1
            self.guard.horizon = None
            return []
        self.pilot.streamed(now)
        return [message]

    def _encode(self, **links: list[Message]) -> list[Datagram]:
        out = []
        for link, messages in links.items():
            if messages:
                codec = self._codecs[link]
                out.append(Datagram(link, b"".join(codec.encode(message) for message in messages)))
        return out
