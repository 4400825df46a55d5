"""Node of the companion computer: receive → world → flight → health → plan → set-point → bytes.

The node uses no socket and no clock.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from companion.avoidance.certified.fleet_clock import FleetClock
from companion.avoidance.field.plan_log import PlanLog
from companion.config import CompanionConfig
from companion.config.planning import MethodName
from companion.estimation.time_sync import RoundTrips
from companion.flight.orders import Orders
from companion.flight.state_machine import Pilot
from companion.goals.goals import Goals
from companion.health_checks import HealthChecks, report_silence
from companion.planning.avoidance import Avoidance, Tally
from companion.planning.certified import CertifiedAvoidance, VehicleParts
from companion.planning.field import FieldAvoidance
from companion.planning.fleet_time import FleetTimeAvoidance
from companion.planning.plan_times import PlanTimes
from companion.planning.planning import Planning
from companion.planning.setpoints import Setpoints
from companion.telemetry.metrics import Metrics
from companion.telemetry.reception import LINKS, accepts
from companion.telemetry.sharing import NOTHING_SHARED, Sharing
from companion.telemetry.status_text import StatusReporter
from companion.values.components import COMPONENT
from companion.values.horizon import Horizon
from companion.values.phase import Phase
from companion.world import World
from mavlink_bridge.clocks.system_clock import SystemClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Message, Source, SystemTime, Timesync
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec, Counters
from mavlink_bridge.wire.signing import Signing


class Companion:
    """Companion of one vehicle, a ``Node``.

    Links: ``autopilot``, ``swarm``, ``target``, ``ground``. ``stopwatch`` (ns) only measures how long
    planning takes, for metrics and summaries. ``signing`` is the companion's own instance for all links; the
    index of a link in ``LINKS`` is its link id. Without ``signing`` the companion accepts signed and unsigned
    messages alike. ``system_clock`` reads the computer's clock, a source of fleet time where it is measured.
    """

    pilots: ClassVar[type[Pilot]] = Pilot
    """Class of ``pilot``; subclasses replace it."""

    def __init__(
        self,
        config: CompanionConfig,
        system: int,
        target_system: int,
        fleet: FleetFrame,
        stopwatch: Callable[[], int],
        signing: Signing | None = None,
        system_clock: SystemClock | None = None,
    ) -> None:
        self.config = config
        self.system_clock = system_clock
        self.name = f"companion-{system}"
        self._source = own = Source(system, COMPONENT)
        self.world = world = World(config, system, target_system, fleet)
        self._signing = signing
        self._codecs = {
            link: Codec(
                accepts(link, system, target_system, config, world.neighbours.ignores), signing, number
            )
            for number, link in enumerate(LINKS)
        }
        self.pilot = pilot = self.pilots(config, own, fleet.altitude)
        self._metrics = Metrics(config, own)
        self._times = times = PlanTimes(stopwatch, self._metrics.note)
        self._fleet_clock = (
            FleetClock(config.certified, own, system_clock)
            if config.avoidance == "certified" and config.certified.fleet_time == "measured"
            else None
        )
        self.avoidance: Avoidance
        if config.avoidance == "field":
            self.avoidance = FieldAvoidance(config, world, pilot, times)
        else:
            parts, clock = VehicleParts(config, own, fleet, world, pilot, times), self._fleet_clock
            self.avoidance = CertifiedAvoidance(parts) if clock is None else FleetTimeAvoidance(parts, clock)
        self._goals = Goals(config, system, pilot, self.avoidance.lookahead_s, target_system)
        self._orders = Orders(config, own, fleet, pilot, self._goals)
        self._planning = Planning(config, world, pilot, self._goals, self.avoidance)
        self._setpoints = Setpoints(config, own, pilot, self.avoidance, self._planning)
        self._sharing = Sharing(config, own, fleet)
        self.round_trips = RoundTrips(own, regular=world.cameras is not None)
        self.reporter = StatusReporter(config.ground_messages, own)
        self._checks = HealthChecks(
            config,
            world,
            pilot,
            self.avoidance,
            self.round_trips,
            self.reporter,
            self._fleet_clock,
            self._goals,
        )
        self.health = self._checks.monitor
        self._reports_on = config.ground_messages.texts or config.ground_messages.values
        self._started = self._finishing = self._acted = False

    @property
    def system(self) -> int:
        """System id of the vehicle and of its companion."""
        return self._source.system

    @property
    def flown(self) -> Horizon | None:
        """Horizon that is flown; None while set-points do not control the vehicle."""
        return self.avoidance.horizon

    @property
    def tally(self) -> Tally:
        """Counters for the summary."""
        fusion = self.world.fusion
        return self.avoidance.tally if fusion is None else self.avoidance.tally._replace(fusion=fusion)

    @property
    def plan_log(self) -> PlanLog:
        """Log of the field's plans since the last ``shed``."""
        return self.avoidance.log

    @property
    def not_finite(self) -> int:
        """Number of set-points that were not finite and therefore not sent."""
        return self._setpoints.not_finite

    @property
    def last_spent(self) -> int | None:
        """Stopwatch reading (ns) of the last plan; None without a plan since the last ``shed``."""
        spent = self._times.plan_ns
        return spent[-1] if spent else None

    @property
    def counters(self) -> Mapping[str, Counters]:
        """Counters of the received bytes and frames of each link, by link."""
        return {link: codec.counters for link, codec in self._codecs.items()}

    @property
    def bad_frames(self) -> int:
        """Number of false starts, wrong checksums and invalid values in the received bytes of all links."""
        return sum(codec.counters.bad for codec in self._codecs.values())

    def use(self, methods: tuple[MethodName, ...]) -> None:
        """Use ``methods`` from the next plan on, and for the selection of relevant neighbours."""
        self.avoidance.use(methods)
        self.world.neighbours.relevance.use(methods)

    def shed(self) -> Sequence[int]:
        """Remove and return the stopwatch readings (ns), and empty the plan log.

        Call this regularly in processes that run for days; both grow with every plan.
        """
        self.avoidance.shed()
        self.world.shed()
        return self._times.shed()

    def finish(self) -> None:
        """Make no further committed plan: fly the last one to its end, and announce it as the last."""
        self._finishing = True
        self.avoidance.finish()

    def rests(self, now: int) -> bool:
        """Return whether no committed plan is flown, or the flown one is at rest at ``now`` (µs)."""
        return not self.pilot.streaming or self.avoidance.rests(now)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Handle the messages that arrived and do what is due at ``now`` (µs)."""
        if not self._started:
            self._start(now)
        if self._signing is not None:
            self._signing.present(now)
        answers = self._receive(now, inbox)
        self._acted = self._has_to_act(now)
        if not self._acted:
            return self._encode(ground=answers)
        view = self.world.at(now)
        self.pilot.column_waits = self.avoidance.wait(now)
        commands = self.pilot.step(now, view)
        self.world.doubt = self.pilot.vehicle.positioning.radius + self.avoidance.tracking.excess
        requests: list[Message] = [*self.round_trips.due(now, self.world.late)]
        if self._fleet_clock is not None:
            requests += self._fleet_clock.requests(now)
        self._checks.step(now, view, late=now - self._setpoints.next_due)
        self._goals.forget(view)
        self._planning.step(now, view, cautious=self.health.blinkered)
        setpoints = self._setpoints.due(now, view)
        shared = NOTHING_SHARED
        if now >= self._sharing.next_due:
            shared = self._sharing.due(now, view, self.avoidance.shared(now, view), self.world.doubt)
        leaving = self.pilot.phase in (Phase.LAND, Phase.DONE) or (self._finishing and self.pilot.streaming)
        announced = self.avoidance.messages(now, farewell=leaving or self.avoidance.parked)
        autopilot = [*commands, *requests, *setpoints, *shared.autopilot]
        detections = self._sharing.detections(self.world.forwards(now))
        swarm, ground = [*shared.swarm, *detections, *announced], answers
        if self._reports_on:
            reports = self._reports(now)
            autopilot += reports.get("autopilot", ())
            ground += reports.get("ground", ())
        return self._encode(autopilot=autopilot, swarm=swarm, ground=ground)

    def recall(self) -> bool:
        """Recall the plan that the last step made; return whether its messages may be left unsent.

        For a step that took so long that its set-points are old and its committed plan may have to have begun
        by now: the plan of before is carried on, as the backup node does. Returns False in field mode, and
        for a plan that cannot be recalled. Plans, statements and commands are repeated by later steps;
        replies to TIMESYNC, detections and status texts are lost, and messages of fleet time come later.
        """
        return self._acted and self.avoidance.recall()

    def _start(self, now: int) -> None:
        """Start the periods of avoidance, set-points and health checks at ``now`` (µs), the first step."""
        self._started = True
        self.avoidance.next_due = now
        self._setpoints.start(now)
        self._checks.start(now)

    def _has_to_act(self, now: int) -> bool:
        """Return whether anything is due; in phase ESCORT a step before the next deadline only receives."""
        return (
            self.pilot.phase is not Phase.ESCORT
            or not self.avoidance.idle(now)
            or now >= min(self._setpoints.next_due, self._sharing.next_due)
        )

    def _receive(self, now: int, inbox: Sequence[Datagram]) -> list[Message]:
        """Receive the messages of ``inbox``; return the answers for the ground."""
        answers: list[Message] = []
        world, avoidance, codecs = self.world, self.avoidance, self._codecs
        world.neighbours.relevance.now = now
        for link, data in inbox:
            for message in codecs[link].feed(data, whole=True):
                if link == "ground":
                    answers += self._orders.obey(message)
                    continue
                if link == "autopilot":
                    self.pilot.receive(message)
                    if isinstance(message, SystemTime | Timesync):
                        self._receive_time(now, message)
                        continue
                if not avoidance.receive(now, link, message):
                    world.receive(now, link, message)
        return answers

    def _receive_time(self, now: int, message: SystemTime | Timesync) -> None:
        """Process SYSTEM_TIME, or a TIMESYNC that may answer a request for the autopilot's time."""
        if self._fleet_clock is not None:
            self._fleet_clock.receive(now, "autopilot", message)
        if isinstance(message, SystemTime):
            return
        answer = self.round_trips.receive(message)
        if answer is not None:
            self.world.answered(now, answer)

    def _reports(self, now: int) -> dict[str, list[Message]]:
        """Return status texts and metrics, by the link that carries them."""
        report_silence(now, self.world, self.reporter)
        messages: list[Message] = [*self.reporter.due(now)]
        messages += self._metrics.due(now, self.avoidance.held, self.world.target.age(now))
        return dict.fromkeys(self.config.ground_messages.links, messages)

    def _encode(self, **links: list[Message]) -> list[Datagram]:
        """Return one datagram for each link that has messages."""
        out = []
        for link, messages in links.items():
            if messages:
                codec = self._codecs[link]
                out.append(Datagram(link, b"".join([codec.encode(message) for message in messages])))
        return out
