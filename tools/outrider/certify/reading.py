"""Evidence from a run directory: the configuration gives the terms, the logs give plans and statements."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from heapq import merge
from operator import itemgetter
from pathlib import Path

from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.fingerprint import identity
from companion.config.obstacles import Obstacle
from companion.values.components import COMPONENT
from mavlink_bridge.errors import LogError, PlanWireError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandLong, Tunnel
from mavlink_bridge.tlog.log import Record, read_tlog
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE as FLEET_TIME
from mavlink_bridge.wire.fleet_time import unpack as unpack_fleet_time
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import unpack as unpack_plan
from outrider.certify.distances import for_column, of_plans, of_surfaces
from outrider.certify.evidence import (
    Evidence,
    FarewellChange,
    Log,
    LoggedPlan,
    LoggedStatement,
    Order,
    Terms,
    UnreadablePayloads,
    milli,
)
from outrider.certify.fly_runs import fly_runs, is_of_backup, logs_of, obstacles_of, terms_of_runs
from outrider.certify.ranges import reach_of
from outrider.errors import Fault, InputError
from outrider.runs import names
from outrider.runs.configuration import CONFIGURATION, resolved
from outrider.scenarios.companion_settings import settings_of
from outrider.scenarios.scenario import Scenario

_ALLOWED = (
    "allowed: what outrider swarm SCENARIO --avoidance certified --out leaves, "
    "or a directory with runs of outrider fly with companion.avoidance certified"
)
_LAG_US = 500_000
"""Time by which the records of a backup node are moved behind those of its companion.

It logs copies of what the companion receives and sends. Only those count that a companion's own log lacks,
because it was killed.
"""
_REPEATED_US = 1_000_000
"""Largest difference of the times at which two processes of one companion log the same frame."""
_RECORDS_PER_REPORT = 4096
"""Number of records between two progress reports."""

Watch = Callable[[str, float], None]


def read(directory: Path, watch: Watch) -> Evidence:
    """Read all evidence in ``directory``: of a scenario, or of runs of ``outrider fly`` in it or below.

    ``watch`` receives the name of the log and the share (0…1) of all logs' bytes that was read. Raises
    InputError for a directory without evidence.
    """
    runs = fly_runs(directory) if directory.is_dir() else []
    if runs:
        return _evidence(directory, terms_of_runs(runs), logs_of(runs), obstacles_of(runs), watch)
    path = directory / CONFIGURATION
    scenario = resolved(directory, _ALLOWED).scenario
    if scenario.companion.avoidance != "certified":
        flown = scenario.companion.avoidance
        raise InputError(Fault(str(path), f"flown with scenario.companion.avoidance {flown!r}; {_ALLOWED}"))
    found = {system: [directory / names.log(system)] for system in scenario.systems}
    present = {system: logs for system, logs in found.items() if logs[0].is_file()}
    terms = terms_of(scenario)
    known = dict.fromkeys(terms.fleet, settings_of(scenario).obstacles)
    return _evidence(directory, terms, present, known, watch)


def _evidence(
    directory: Path,
    terms: Terms,
    found: dict[int, list[Path]],
    obstacles: Mapping[int, tuple[Obstacle, ...]],
    watch: Watch,
) -> Evidence:
    """Read the logs ``found`` of each vehicle, by system id, as are the ``obstacles`` that it knows."""
    size = sum(log.stat().st_size for logs in found.values() for log in logs)
    if not size:
        raise InputError(Fault(str(directory), f"holds no log vehicle-N.tlog; {_ALLOWED}"))
    logs, faults, done = [], [], 0
    for system, paths in found.items():

        def sent(at: int, name: str = names.log(system), before: int = done) -> None:
            watch(name, (before + at) / size)

        try:
            logs.append(_read(system, paths, sent))
        except LogError as error:
            faults.append(str(error))
        done += sum(path.stat().st_size for path in paths)
    if not any(log.sightings for log in logs):
        count = sum(map(len, found.values()))
        wrong = faults[0] if faults and not logs else f"{directory}: its {count} logs hold no plan"
        raise InputError(f"{wrong}; {_ALLOWED}")
    return Evidence(terms, tuple(logs), obstacles)


def terms_of(scenario: Scenario) -> Terms:
    """Return the terms on which the companions of a scenario agree."""
    config = settings_of(scenario)
    certified, limits, origin = config.certified, config.limits, scenario.origin
    return Terms(
        certified.fleet,
        frozenset(scenario.moving_systems),
        certified.dt_us,
        certified.epoch_us,
        config.horizon.steps + 1,
        identity(config, FleetFrame(origin.latitude, origin.longitude, origin.altitude)),
        of_plans(config),
        milli(limits.u_max),
        config.planar,
        for_column(config),
        config.field.downwash,
        of_surfaces(config),
        reach_of(config),
        milli(limits.least_u),
        config.plane_shift,
    )


class _Tally:
    """Contents of the logs of one vehicle so far; copies of a plan are counted, and it is decoded once."""

    def __init__(self, owner: int) -> None:
        self._owner = owner
        self._plans: dict[tuple[int, bytes], tuple[int, int, int]] = {}
        self._received: set[tuple[int, bytes]] = set()
        self._garbled: dict[int, UnreadablePayloads] = {}
        self._words: list[FarewellChange] = []
        self._statements: list[LoggedStatement] = []
        self._orders: list[Order] = []
        self._ahead = 0
        self._since = self._ordered_since = 0

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

    def order(self, number: int, time: int, message: CommandLong) -> None:
        """Add a command of the companion to its autopilot; only take-off and landing count.

        A repetition is not added. The same order after the owner has begun anew is another one.
        """
        climbs = message.command == mavlink.MAV_CMD_NAV_TAKEOFF
        if not climbs and message.command != mavlink.MAV_CMD_NAV_LAND:
            return
        again = self._since > self._ordered_since
        if not self._orders or self._orders[-1].climbs != climbs or again:
            self._ordered_since = self._since
            self._orders.append(Order(time + self._ahead, climbs, number))

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
        self._since = max(self._since, statement.since)
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
        statements, orders = tuple(self._statements), tuple(self._orders)
        return Log(self._owner, tuple(sightings), statements, garbled, words, damaged, orders)


def _read(owner: int, paths: Sequence[Path], at: Callable[[int], None]) -> Log:
    """Read the logs of one vehicle, in the order of time; ``at`` receives the number of bytes read.

    Raises LogError.
    """
    tally, repeated = _Tally(owner), _Repeated()
    own = owner, COMPONENT
    codec = Codec(
        lambda identifier, system, component: (
            identifier == mavlink.MAVLINK_MSG_ID_TUNNEL
            or (identifier == mavlink.MAVLINK_MSG_ID_COMMAND_LONG and (system, component) == own)
        )
    )
    readers, size = [read_tlog(path) for path in paths], 0
    lags = [_LAG_US if is_of_backup(path) else 0 for path in paths]
    shifted = [_timed(reader, lag) for reader, lag in zip(readers, lags, strict=True)]
    for number, (_, record) in enumerate(merge(*shifted, key=itemgetter(0))):
        size += 8 + len(record.frame)
        if number % _RECORDS_PER_REPORT == 0:
            at(size)
        for message in codec.feed(record.frame):
            if not isinstance(message, Tunnel | CommandLong):
                continue
            if len(paths) > 1 and repeated(record.time, record.frame):
                continue
            if isinstance(message, CommandLong):
                tally.order(number, record.time, message)
            else:
                tally.add(number, record.time, message)
    reports = [reader.report for reader in readers]
    return tally.log(sum(report.bad + report.truncated for report in reports) + codec.counters.bad)


def _timed(records: Iterable[Record], lag: int) -> Iterator[tuple[int, Record]]:
    """Yield ``records``, each with its time plus ``lag`` (µs)."""
    for record in records:
        yield record.time + lag, record


class _Repeated:
    """Detector of frames that two logs of one vehicle contain: a companion's and its backup node's."""

    def __init__(self) -> None:
        self._seen: dict[bytes, int] = {}

    def __call__(self, time: int, frame: bytes) -> bool:
        """Return whether the same frame was given shortly before ``time`` (µs)."""
        before = self._seen.pop(frame, None)
        # Frames with the same number recur after 256 others, with another epoch in them.
        while self._seen and time - self._seen[oldest := next(iter(self._seen))] > _REPEATED_US:
            del self._seen[oldest]
        if before is not None and time - before <= _REPEATED_US:
            return True
        self._seen[frame] = time
        return False
