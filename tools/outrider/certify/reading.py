"""Evidence from a run directory: the configuration gives the terms, the logs give plans and statements."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.fingerprint import identity
from companion.avoidance.certified.margins import between
from mavlink_bridge.errors import LogError, PlanWireError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Tunnel
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE as FLEET_TIME
from mavlink_bridge.wire.fleet_time import unpack as unpack_fleet_time
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import unpack as unpack_plan
from outrider.certify.evidence import (
    Evidence,
    FarewellChange,
    Log,
    LoggedPlan,
    LoggedStatement,
    Terms,
    UnreadablePayloads,
)
from outrider.errors import Fault, InputError
from outrider.runs import names
from outrider.runs.configuration import CONFIGURATION, resolved
from outrider.scenarios.companion_settings import settings_of
from outrider.scenarios.scenario import Scenario

_ALLOWED = "allowed: what outrider swarm SCENARIO --avoidance certified --out leaves"
_RECORDS_PER_REPORT = 4096
"""Number of records between two progress reports."""

Watch = Callable[[str, float], None]


def read(directory: Path, watch: Watch) -> Evidence:
    """Read all evidence in ``directory``.

    ``watch`` receives the name of the log and the share (0…1) of all logs' bytes that was read. Raises
    InputError for a directory without evidence.
    """
    path = directory / CONFIGURATION
    scenario = resolved(directory, _ALLOWED).scenario
    if scenario.companion.avoidance != "certified":
        flown = scenario.companion.avoidance
        raise InputError(Fault(str(path), f"flown with scenario.companion.avoidance {flown!r}; {_ALLOWED}"))
    found = {system: directory / names.log(system) for system in scenario.systems}
    found = {system: log for system, log in found.items() if log.is_file()}
    if not found:
        raise InputError(Fault(str(directory), f"holds no log vehicle-N.tlog; {_ALLOWED}"))
    size = sum(log.stat().st_size for log in found.values())
    logs, faults, done = [], [], 0
    for system, log in found.items():

        def sent(at: int, name: str = log.name, before: int = done) -> None:
            watch(name, (before + at) / size)

        try:
            logs.append(_read(system, log, sent))
        except LogError as error:
            faults.append(str(error))
        done += log.stat().st_size
    if not any(log.sightings for log in logs):
        wrong = faults[0] if faults and not logs else f"{directory}: its {len(found)} logs hold no plan"
        raise InputError(f"{wrong}; {_ALLOWED}")
    return Evidence(terms_of(scenario), tuple(logs))


def terms_of(scenario: Scenario) -> Terms:
    """Return the terms on which the companions of a scenario agree."""
    config = settings_of(scenario)
    certified, limits, origin = config.certified, config.limits, scenario.origin
    x, y, z = (round(1e3 * most) for most in limits.u_max)
    return Terms(
        certified.fleet,
        frozenset(scenario.moving_systems),
        certified.dt_us,
        certified.epoch_us,
        config.horizon.steps + 1,
        identity(config, FleetFrame(origin.latitude, origin.longitude, origin.altitude)),
        between(certified, config.field, limits),
        (x, y, z),
        config.planar,
    )


class _Tally:
    """Contents of one log so far; copies of a plan are counted, and the plan is decoded once."""

    def __init__(self, owner: int) -> None:
        self._owner = owner
        self._plans: dict[tuple[int, bytes], tuple[int, int, int]] = {}
        self._received: set[tuple[int, bytes]] = set()
        self._garbled: dict[int, UnreadablePayloads] = {}
        self._words: list[FarewellChange] = []
        self._statements: list[LoggedStatement] = []
        self._ahead = 0

    def add(self, number: int, time: int, message: Tunnel) -> None:
        """Add a TUNNEL of any kind, from the record ``number``, at ``time`` (µs) by the owner's clock.

        Where the owner reports fleet time, all times are converted to it, as plans are in fleet time.
        """
        sender, payload = message.source.system, message.payload
        time += self._ahead
        if message.payload_type == FLEET_TIME and sender == self._owner:
            self._convert(payload)
        elif message.payload_type == PLAN:
            first, copies, at = self._plans.get((sender, payload), (time, 0, number))
            self._plans[sender, payload] = first, copies + 1, at
        elif message.payload_type == AGREEMENTS and (sender, payload) not in self._received:
            self._state(number, time, sender, payload)

    def _state(self, number: int, time: int, sender: int, payload: bytes) -> None:
        try:
            statement = unpack_statement(payload)
        except PlanWireError:
            self._garble(sender, time, 1)
            return
        self._statements.append(LoggedStatement(self._owner, sender, statement, time, number))
        if sender != self._owner:
            # A farewell counts only with its plan, which may arrive after the first copy.
            if not statement.farewell:
                self._received.add((sender, payload))
            return
        farewell = statement.farewell
        if not statement.away and farewell != (bool(self._words) and self._words[-1].farewell):
            self._words.append(FarewellChange(time, farewell))

    def _convert(self, payload: bytes) -> None:
        """Take the owner's fleet time; its receivers ignore one that they cannot decode, and so does this."""
        try:
            ahead = unpack_fleet_time(payload).ahead
        except PlanWireError:
            return
        self._ahead = self._ahead if ahead is None else ahead

    def _garble(self, sender: int, time: int, copies: int) -> None:
        bad = self._garbled.get(sender, UnreadablePayloads(self._owner, sender, time, 0))
        self._garbled[sender] = bad._replace(copies=bad.copies + copies)

    def log(self, damaged: int) -> Log:
        """Return the contents; ``damaged`` records could not be read."""
        sightings = []
        for (sender, payload), (time, copies, number) in self._plans.items():
            try:
                sightings.append(LoggedPlan(self._owner, sender, unpack_plan(payload), time, copies, number))
            except PlanWireError:
                self._garble(sender, time, copies)
        garbled, words = tuple(self._garbled.values()), tuple(self._words)
        return Log(self._owner, tuple(sightings), tuple(self._statements), garbled, words, damaged)


def _read(owner: int, path: Path, at: Callable[[int], None]) -> Log:
    """Read one log; ``at`` receives the number of bytes read. Raises LogError."""
    tally = _Tally(owner)
    codec = Codec(lambda identifier, _system, _component: identifier == mavlink.MAVLINK_MSG_ID_TUNNEL)
    reader, size = read_tlog(path), 0
    for number, record in enumerate(reader):
        size += 8 + len(record.frame)
        if number % _RECORDS_PER_REPORT == 0:
            at(size)
        for message in codec.feed(record.frame):
            if isinstance(message, Tunnel):
                tally.add(number, record.time, message)
    report = reader.report
    return tally.log(report.bad + report.truncated + codec.counters.bad)
