"""Node of the check beside one vehicle: it waits for all, measures, and exchanges reports.

It requests messages and parameters of the autopilot, and sends probes, reports and TIMESYNC to the other
companions. It commands nothing, except with ``FlightTerms`` and the operator's go: then the vehicle flies
alone, in its turn (``turns``). No socket and no clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.fingerprint import fingerprint
from companion.values.components import COMPONENT
from mavlink_bridge.clocks.system_clock import SystemClock
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.messages import Message, Source, SystemTime, Timesync, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE as FLEET_TIME
from mavlink_bridge.wire.preflight import PAYLOAD_TYPE, Probe, Report, Turn, pack, unpack
from mavlink_bridge.wire.signing import Signing
from outrider.errors import OutriderError
from outrider.preflight.autopilot import RECEIVED, AutopilotFigures
from outrider.preflight.clock_meter import ClockMeter
from outrider.preflight.exchange import Exchange, in_parts, whole
from outrider.preflight.findings import Check, Result, Verdict
from outrider.preflight.judgement import judge
from outrider.preflight.link_meter import LinkMeter
from outrider.preflight.lone_flight import LoneFlight
from outrider.preflight.own_checks import own_checks
from outrider.preflight.own_report import flight_check, own_report
from outrider.preflight.terms import Phase, Terms
from outrider.preflight.turns import PERIOD_US, Turns

_REPORT_US: Final = 200_000
"""Time between two transmissions of the own report, µs."""
_LINGER_US: Final = 3_000_000
"""Time (µs) for which the own report is sent on when all reports were received."""
_EXCHANGE_US: Final = 30_000_000
"""Largest time (µs) of the exchange: the others may have begun later."""
_CLOCK_PATIENCE_US: Final = 20_000_000
"""Time (µs) from the first step for which the measurement waits for fleet time."""
_NS_PER_US: Final = 1000
_MOST_RUNS: Final = 1_000
_SWARM_IDS: Final = (mavlink.MAVLINK_MSG_ID_TUNNEL, mavlink.MAVLINK_MSG_ID_TIMESYNC)


class Preflight:
    """The check of one vehicle, a ``Node`` with the links ``autopilot`` and ``swarm``.

    ``system_clock`` is a source of fleet time where it is measured. The times of ``step`` must be UTC with
    ``signing``, and should be without: reports are dated by them. ``signing_in_flight``: another instance
    with the same key.
    """

    def __init__(
        self,
        terms: Terms,
        signing: Signing | None = None,
        system_clock: SystemClock | None = None,
        signing_in_flight: Signing | None = None,
    ) -> None:
        self.name = f"preflight-{terms.system}"
        self._terms, self._signing = terms, signing
        self._own = own = Source(terms.system, COMPONENT)
        config = terms.config
        self._fingerprint = fingerprint(config, terms.origin.frame)
        self._codecs = {
            "autopilot": Codec(
                lambda identifier, sender, component: (
                    sender == own.system
                    and component == mavlink.MAV_COMP_ID_AUTOPILOT1
                    and identifier in RECEIVED
                ),
                signing,
            ),
            "swarm": Codec(
                lambda identifier, _sender, component: component == COMPONENT and identifier in _SWARM_IDS,
                signing,
            ),
        }
        certified = config.certified
        utc = certified.fleet_time == "measured" and certified.time_sources.autopilot_us is not None
        self.autopilot = AutopilotFigures(own, planar=config.planar, utc=utc)
        self.clock = ClockMeter(certified, own, system_clock)
        # Plan and statement take two messages in ``repeat_us``.
        self._period = max(certified.repeat_us // 2, 4)
        self.meters = {system: LinkMeter(self._period) for system in terms.others}
        self.phase = Phase.WAIT
        self._began: int | None = None
        self._phase_began = self._now = 0
        self._sequence = self._next_probe = self._next_report = 0
        self._doubled = False
        self._checks: tuple[Check, ...] = ()
        self._parts: list[Report] = []
        self._exchange = Exchange(self.meters, self._fingerprint)
        self._complete_at: int | None = None
        self._signing_in_flight = signing_in_flight
        self._next_turn = 0
        self.turns: Turns | None = None
        """Turns of the flights alone; None without ``terms.fly``."""
        if terms.fly is not None:
            self.turns = Turns(
                terms.system,
                terms.others,
                self._fingerprint,
                None if terms.fly.dry else self._flight,
                round(1e6 * terms.wait_s),
                go=terms.fly.go,
            )

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Receive, measure, and return what is due at ``now`` (µs)."""
        if self._began is None:
            self._began = self._phase_began = now
        self._now = now
        if self._signing is not None:
            self._signing.present(now)
        for link, data in inbox:
            for message in self._codecs[link].feed(data, whole=True):
                self._receive(now, link, message)
        self.autopilot.tick(now)
        self.clock.tick(now)
        self._advance(now)
        flown = self._fly(now, [data for link, data in inbox if link == "autopilot"])
        # In flight the companion alone sends to the autopilot: acknowledgements name no sender.
        quiet = self.flight is not None and not self.flight.over
        found = {
            "autopilot": [] if quiet else [*self.autopilot.requests(now), *self.clock.to_autopilot(now)],
            "swarm": [*self.clock.to_swarm(now), *self._due(now)],
        }
        return [
            *(Datagram("autopilot", data) for data in flown),
            *(
                Datagram(link, self._codecs[link].encode(message))
                for link, messages in found.items()
                for message in messages
            ),
        ]

    @property
    def flight(self) -> LoneFlight | None:
        """Flight of the own vehicle; None before it begins."""
        return None if self.turns is None else self.turns.flight

    @property
    def system(self) -> int:
        """System id of the vehicle."""
        return self._terms.system

    def order(self, now: int, word: str) -> str:
        """Obey the operator's ``go`` or ``land`` at ``now`` (µs); return why not, or an empty string.

        A go is not stored: it counts only while the flight waits for nothing else.
        """
        turns = self.turns
        if word == "land" and turns is not None and self.phase is Phase.TURNS:
            turns.stop(now, "the operator ordered to land")
        elif word != "go" or turns is None or not turns.asks:
            return f"{word}: not now: {self.doing}"
        else:
            turns.go = True
        return ""

    def _flight(self) -> LoneFlight:
        terms, fly, signing = self._terms, self._terms.fly, self._signing_in_flight
        if fly is None:
            raise OutriderError("there are no terms of a flight")
        if signing is not None and self._signing is not None:
            signing.resume(self._signing.newest)
        where = terms.system, fly.target, terms.origin.frame, fly.height, fly.box
        return LoneFlight(terms.config, *where, signing)

    def _fly(self, now: int, inbox: list[bytes]) -> list[bytes]:
        """Fly alone, if it is the own turn; return what is to be sent to the autopilot."""
        turns = self.turns
        if turns is None or self.phase is not Phase.TURNS:
            return []
        if self._doubled:
            turns.stop(now, "another companion has this id")
        sent = turns.step(now, inbox, disarmed=self.autopilot.disarmed(now))
        if self._signing is not None and self._signing_in_flight is not None:
            self._signing.resume(self._signing_in_flight.newest)
        if turns.over(now):
            self._begin(now, Phase.EXCHANGE)
            self._report(now)
        return sent

    def _receive(self, now: int, link: str, message: Message) -> None:
        if link == "autopilot":
            self.autopilot.receive(now, message)
            if isinstance(message, SystemTime | Timesync):
                self.clock.receive(now, link, message)
            return
        system = message.source.system
        if isinstance(message, Tunnel) and message.payload_type == PAYLOAD_TYPE:
            self._receive_tunnel(now, system, message.payload)
        elif system != self._own.system and isinstance(message, Timesync):
            self.clock.receive(now, link, message)
            asked, asker = divmod(message.ts1, _NS_PER_US)
            if message.tc1 > 0 and asker == self._own.system and system in self.meters and asked <= now:
                self.meters[system].add_round_trip(now - asked)
        elif isinstance(message, Tunnel) and message.payload_type == FLEET_TIME:
            self.clock.receive(now, link, message)

    def _receive_tunnel(self, now: int, system: int, payload: bytes) -> None:
        try:
            message = unpack(payload)
        except PlanWireError:
            return
        if system == self._own.system:
            # A multicast link returns the own messages.
            self._doubled |= message.run != self._terms.run
        elif isinstance(message, Turn):
            if self.turns is not None:
                self.turns.receive(now, system, message)
        elif system in self.meters:
            if isinstance(message, Probe):
                self.meters[system].receive(now, message)
            else:
                self._exchange.receive(system, message)

    def _advance(self, now: int) -> None:
        terms, passed = self._terms, now - self._phase_began
        if self.phase is Phase.WAIT:
            if not self._lacking(now) or passed >= 1e6 * terms.wait_s or self._doubled:
                self._begin(now, Phase.MEASURE)
                self.autopilot.begin()
                self.clock.begin()
                for meter in self.meters.values():
                    meter.begin()
        elif self.phase is Phase.MEASURE:
            if passed >= 1e6 * terms.seconds:
                self._report(now)
                if self.turns is None or not self._passed or self._exchange.refused():
                    self._end_turns()
                    self._begin(now, Phase.EXCHANGE)
                else:
                    self._begin(now, Phase.TURNS)
                    self._parts = []
        elif self.phase is Phase.EXCHANGE:
            if self._complete_at is None and not self._exchange.awaited():
                self._complete_at = now
            lingered = self._complete_at is not None and now - self._complete_at >= _LINGER_US
            if lingered or passed >= _EXCHANGE_US:
                self._begin(now, Phase.OVER)

    def _begin(self, now: int, phase: Phase) -> None:
        self.phase, self._phase_began = phase, now

    def _lacking(self, now: int) -> str:
        """Return what the measurement waits for, or an empty string."""
        if lacking := self.autopilot.lacking(now):
            return lacking
        silent = [system for system, meter in self.meters.items() if not meter.heard(now)]
        if silent:
            return f"preflight of vehicle{'s' * (len(silent) > 1)} {', '.join(map(str, silent))}"
        late = self._began is not None and now - self._began > _CLOCK_PATIENCE_US
        return "" if late or self.clock.ready(now) else "fleet time"

    @property
    def _passed(self) -> bool:
        return all(check.result is not Result.FAIL for check in self._checks)

    def _end_turns(self) -> None:
        if self.turns is not None:
            self.turns.end("")

    def _report(self, now: int) -> None:
        """Check the own vehicle, and make the report that is sent from now on."""
        terms, turns, clock = self._terms, self.turns, self.clock.bound
        flown, drift = (terms.flown, None) if turns is None else (turns.result, turns.drift)
        own = terms.system, terms.config, self.autopilot
        checks = own_checks(*own, clock, flown, drift, doubled=self._doubled)
        self._checks = (*checks, *flight_check(terms, turns))
        links = [meter.figure(now).report(system) for system, meter in self.meters.items()]
        figures = self.autopilot.sigma, clock, flown
        report = own_report(now, terms, self._fingerprint, self.autopilot, figures, passed=self._passed)
        self._parts = in_parts(report, links)

    def _due(self, now: int) -> list[Message]:
        """Return the probe and the own report, as far as they are due."""
        found: list[Message] = []
        if now >= self._next_probe:
            self._next_probe = now + self._period
            found.append(self._tunnel(Probe(self._terms.run, self._fingerprint, self._sequence, now)))
            self._sequence += 1
        if self.turns is not None and now >= self._next_turn:
            self._next_turn = now + PERIOD_US
            disarmed = self.autopilot.disarmed(now)
            found.append(self._tunnel(self.turns.message(self._terms.run, disarmed=disarmed)))
        if self._parts and now >= self._next_report:
            self._next_report = now + _REPORT_US
            found += [self._tunnel(part) for part in self._parts]
        return found

    def _tunnel(self, message: Probe | Report | Turn) -> Tunnel:
        return Tunnel(self._own, 0, 0, PAYLOAD_TYPE, pack(message))

    @property
    def over(self) -> bool:
        """Whether the check has ended."""
        return self.phase is Phase.OVER

    @property
    def doing(self) -> str:
        """Description of what it does now."""
        if self.phase is Phase.WAIT:
            return f"waiting for {self._lacking(self._now) or 'nothing'}"
        if self.phase is Phase.TURNS and self.turns is not None:
            return self.turns.doing
        if self.phase is Phase.EXCHANGE:
            silent = ", ".join(map(str, self._exchange.awaited()))
            return f"exchanging reports{f', none of {silent}' if silent else ''}"
        return str(self.phase.value)

    @property
    def share(self) -> float:
        """Share (0…1) of the present phase that has passed."""
        terms = self._terms
        longest = {Phase.WAIT: 1e6 * terms.wait_s, Phase.MEASURE: 1e6 * terms.seconds}
        passed = self._now - self._phase_began
        return min(passed / max(longest.get(self.phase, _EXCHANGE_US), 1.0), 1.0)

    def verdict(self) -> Verdict:
        """Return the verdict on all that was reported."""
        terms, exchange = self._terms, self._exchange
        missing, reports = {**exchange.refused(), **exchange.awaited()}, exchange.reports()
        if self._parts:
            reports[terms.system] = whole(self._parts)
        return judge(self._checks, reports, missing, terms.config, terms.origin, terms.seconds)
