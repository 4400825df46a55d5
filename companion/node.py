"""Node of the companion computer: receive → world → plan → guard → set-point → bytes.

It uses no socket and no clock.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.field.plan_log import PlanLog
from companion.avoidance.field.planner import Plan, Planner
from companion.config import CompanionConfig
from companion.config.planning import MethodName
from companion.estimation.time_sync import RoundTrips
from companion.flight.guard import Guard
from companion.flight.health_monitor import HealthMonitor, Situation
from companion.flight.orders import Orders
from companion.flight.reactions import Reactions
from companion.flight.setpoint import is_finite, setpoint
from companion.flight.state_machine import Pilot
from companion.goals.goals import Goals
from companion.planning import Planning, Tally
from companion.telemetry.metrics import Metrics
from companion.telemetry.reception import LINKS, accepts
from companion.telemetry.sharing import Sharing
from companion.telemetry.silence import report_silence
from companion.telemetry.status_text import Severity, StatusReporter
from companion.values.components import COMPONENT
from companion.values.horizon import Horizon
from companion.values.phase import Phase
from companion.world import View, World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, Source, Timesync, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec, Counters
from mavlink_bridge.wire.signing import Signing

_LOOK = 100_000
"""Period of the health checks, µs."""
_PLAIN = str.maketrans({"²": "2", "³": "3", "°": "deg"})
"""Replacements for STATUSTEXT, which is ASCII."""
_NOTHING: dict[str, list[Message]] = {"autopilot": [], "ground": []}


class Companion:
    """Companion of one vehicle, a ``Node``.

    Links: ``autopilot``, ``swarm``, ``target``, ``ground``. ``stopwatch`` (ns) only measures how long
    planning takes; nothing depends on it. ``signing`` is the companion's own instance for all links; the
    index of a link in ``LINKS`` is its link id. Without ``signing`` the companion accepts signed and unsigned
    messages alike.
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
        self.world = World(config, system, target_system, fleet)
        self.pilot = self.pilots(config, self._source, fleet.altitude)
        self._sharing = Sharing(config, self._source, fleet)
        self.voice = StatusReporter(config.voice, self._source)
        self._metrics = Metrics(config, self._source)
        self._signing = signing
        neighbours = self.world.neighbours
        self._relevance = neighbours.relevance
        self._codecs = {
            link: Codec(accepts(link, system, target_system, config, neighbours.ignores), signing, number)
            for number, link in enumerate(LINKS)
        }
        self.watch = HealthMonitor(config)
        self._reactions = Reactions()
        self._round_trips = RoundTrips(self._source)
        self._next_look = self._looked_late = self._remarked = 0
        self._certified = (
            CertifiedFlight(config, self._source, fleet) if config.avoidance == "certified" else None
        )
        ahead = (config.horizon.steps + 1) * config.horizon.dt_us * 1e-6
        certified = self._certified
        self._goals = Goals(config, system, self.pilot, ahead if certified is None else certified.seconds)
        self._orders = Orders(config, self._source, fleet, self.pilot, self._goals)
        self._planning = Planning(
            config, self.world, self.pilot, self._goals, certified, stopwatch, self._metrics.note
        )
        self._boot: int | None = None
        self._next_setpoint = 0
        self.not_finite = 0
        """Number of set-points that were not finite and therefore not sent."""

    @property
    def tally(self) -> Tally:
        """Counters for the summary."""
        return self._planning.tally

    @property
    def held(self) -> int:
        """Number of times that an old plan was kept."""
        return self._planning.held

    @property
    def planner(self) -> Planner:
        """Planner that makes the plans, except where plans are committed."""
        return self._planning.planner

    @property
    def guard(self) -> Guard:
        """Guard that holds the horizon that is flown."""
        return self._planning.guard

    @property
    def plan(self) -> Plan | None:
        """Last plan of the planner; None before the first."""
        return self._planning.plan

    @property
    def plan_log(self) -> PlanLog:
        """Log of all plans of the planner since the last ``shed``."""
        return self._planning.log

    @property
    def flown(self) -> Horizon | None:
        """Horizon that is flown; None while the companion steers nothing."""
        return self.guard.horizon

    @property
    def last_spent(self) -> int | None:
        """Stopwatch reading (ns) of the last plan; None without a plan since the last ``shed``."""
        spent = self._planning.spent
        return spent[-1] if spent else None

    def use(self, methods: tuple[MethodName, ...]) -> None:
        """Use ``methods`` from the next plan on."""
        self.planner.use(methods)
        self._relevance.use(methods)

    def shed(self) -> Sequence[int]:
        """Remove and return the stopwatch readings (ns), and empty the plan log.

        For processes that run for days.
        """
        return self._planning.shed()

    @property
    def system(self) -> int:
        """System id of the vehicle and of its companion."""
        return self._source.system

    @property
    def counters(self) -> Mapping[str, Counters]:
        """Counters of the received bytes and frames of each link, by link."""
        return {link: codec.counters for link, codec in self._codecs.items()}

    @property
    def bad_frames(self) -> int:
        """Number of frames, on all links, that the codec could not decode."""
        return sum(codec.counters.bad for codec in self._codecs.values())

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Handle the messages that arrived and do what is due at ``now`` (µs)."""
        if self._boot is None:
            self._boot = self._planning.next_due = self._next_setpoint = self._next_look = now
        if self._signing is not None:
            self._signing.present(now)
        answers = self._receive(now, inbox)
        if not self._has_to_act(now):
            return self._encode(ground=answers)
        view = self.world.at(now)
        commands = self.pilot.step(now, view)
        self.world.doubt = self.pilot.vehicle.positioning.radius + self._planning.tracking.excess
        asked = self._round_trips.due(now, self.world.late)
        self._look(now, view)
        self._goals.forget(view)
        self._planning.fly(now, view, cautious=self.watch.blinkered)
        setpoints = self._setpoints(now, view)
        certified = self._certified
        shared = self._sharing.due(now, view, self._planning.told(now, view), self.world.doubt)
        leaving = self.pilot.phase in (Phase.LAND, Phase.DONE)
        told = [] if certified is None else certified.messages(now, farewell=leaving)
        said = self._said(now)
        return self._encode(
            autopilot=[*commands, *asked, *setpoints, *shared.autopilot, *said["autopilot"]],
            swarm=shared.swarm + told,
            ground=[*answers, *said["ground"]],
        )

    def _said(self, now: int) -> dict[str, list[Message]]:
        """Return the messages for the ground by link: events and metrics."""
        if not (self.config.voice.texts or self.config.voice.values):
            return _NOTHING
        report_silence(now, self.world, self.voice)
        said: list[Message] = [*self.voice.due(now)]
        said += self._metrics.due(now, self.held, self.world.target.age(now))
        return {link: said if link in self.config.voice.links else [] for link in ("autopilot", "ground")}

    def _has_to_act(self, now: int) -> bool:
        """Return whether anything is due; in the escort only messages are received between two deadlines."""
        return (
            self.pilot.phase is not Phase.ESCORT
            or (self._certified is not None and not self._certified.idle(now))
            or now >= min(self._planning.next_due, self._next_setpoint, self._sharing.next_due)
        )

    def _receive(self, now: int, inbox: Sequence[Datagram]) -> list[Message]:
        answers: list[Message] = []
        self._relevance.now = now
        for link, data in inbox:
            for message in self._codecs[link].feed(data, whole=True):
                if link == "ground":
                    answers += self._orders.obey(message)
                    continue
                if link == "autopilot":
                    self.pilot.receive(message)
                    if isinstance(message, Timesync):
                        self._receive_time(now, message)
                        continue
                if self._certified is not None and link == "swarm" and isinstance(message, Tunnel | Timesync):
                    self._certified.receive(now, message)
                else:
                    self.world.receive(now, link, message)
        return answers

    def _receive_time(self, now: int, message: Timesync) -> None:
        """Process a TIMESYNC that may answer this companion's request for the autopilot's time."""
        answer = self._round_trips.receive(message)
        if answer is not None:
            self.world.answered(now, answer)

    def _look(self, now: int, view: View) -> None:
        """Run the health checks ten times a second and react to each concern that begins."""
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
            self.world.clock_lost,
            self._round_trips.unanswered(now),
            float(np.linalg.norm(self._planning.tracking.error)) if self.pilot.streaming else 0.0,
            self.world.neighbours.nearest(now, view.own),
        )
        for change in self.watch.look(situation):
            concern = change.concern
            if concern.name != "target":  # ``report_silence`` reports the target
                self.voice.report(concern.severity, concern.text, begins=change.begins)
            self._reactions.note(change)
        self._reactions.follow(self.pilot)
        self._tell_limits()

    def _tell_limits(self) -> None:
        """Report to the ground what was found out about the autopilot's limits."""
        limits = self.pilot.limits
        new = min(limits.said - self._remarked, len(limits.remarks))
        for text in list(limits.remarks)[len(limits.remarks) - new :]:
            self.voice.say(Severity.WARNING, text.translate(_PLAIN))
        self._remarked = limits.said

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
        yaw = self._planning.yaw(time)
        message = setpoint(
            time,
            since_boot,
            horizon,
            yaw,
            view.local,
            self._source,
            profile.setpoint_mask,
            self._planning.tracking.compensation,
            self._planning.tracking.bias,
            self._planning.fastest,
            0 if self._certified is not None else self._planning.tracking.lead(self.pilot.loop),
        )
        if not is_finite(message):
            # Such a set-point must not be sent: the plan starts anew at the measured position.
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
