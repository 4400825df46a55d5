"""Shadow run: a companion receives a log, and its set-points are compared with those of the log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.shadow import ShadowCompanion
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.frames import FleetFrame, enu_to_ned
from mavlink_bridge.messages import (
    GlobalPosition,
    GpsGlobalOrigin,
    LocalPosition,
    Message,
    SetpointLocal,
    Source,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.tlog.log import Record
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.header import header
from outrider.logs.timeline import IDLE, on_one_line
from outrider.scenarios.part import TARGET_SYSTEM
from outrider.shadow.roles import OwnRecords, Part, Roles
from outrider.simulation.beacon import Beacon
from outrider.simulation.paths import Motion
from outrider.supervision.supervised_node import SupervisedNode

_INVALID_TIME_US = 1 << 60
"""µs, 36,000 years after 1970: damage."""
STEP = 10_000
"""µs"""
_RATE_HZ = 5.0

Sent = tuple[int, SetpointLocal]


@dataclass
class ShadowRun:
    """Results of a shadow run.

    ``would``: set-points that the companion would have sent; ``sent``: those that were, each with its time
    (µs of the log); ``places``: (time, position (3,)) NED of the vehicle itself, local as the set-points are.
    ``reasons``: number of 10 ms steps without a set-point, by the missing input; ``holds``: number of held
    plans; ``records``: number of records read; ``damaged``: number of damaged records of the log.
    """

    would: list[Sent] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    places: list[tuple[int, tuple[float, float, float]]] = field(default_factory=list)
    reasons: Counter[str] = field(default_factory=Counter)
    holds: int = 0
    records: int = 0
    damaged: int = 0


def shadow_flight(
    config: CompanionConfig,
    cast: Roles,
    seen: OwnRecords,
    records: Iterable[Record],
    on_step: Callable[[int, int], None] = lambda _now, _records: None,
    fleet: FleetFrame | None = None,
    follow: bool = False,
) -> ShadowRun:
    """Step a shadow companion every 10 ms of the log's time with the records up to then.

    Without a target in ``cast``, a fixed target is below the own vehicle's first position, at height 0 of the
    ``fleet`` frame, which is the log's own unless one is given. ``on_step`` is called with the time (µs) and
    the number of records read.

    With ``follow`` the companion uses the vehicle's clock, as ``outrider fly`` does. Otherwise the data of a
    vehicle whose clock is 1 % slower than the recorder's would appear ever older, and the plans would begin
    ever further ahead of the vehicle.
    """
    fleet = seen.fleet if fleet is None else fleet
    system = next(n for n in (TARGET_SYSTEM, 1, 2, 3) if n not in seen.systems and n != cast.own)
    target = system if cast.target is None else cast.target
    companion = ShadowCompanion(config, cast.own, target, fleet, lambda: 0)
    standing = None if cast.target is not None else Beacon(system, "target", _RATE_HZ, fleet)
    here = fleet.to_enu(*seen.place) * (1.0, 1.0, 0.0)
    found, reader, stand_in = ShadowRun(), Codec(), _Substitute(cast.own, seen, fleet)
    wall = SimulatedClock(seen.begin)
    followed = FollowedClock(wall, seen.begin) if follow else None
    supervised = SupervisedNode(companion, wall, followed, None)
    for now, batch in steps(records):
        wall.wait_until(now)
        inbox = []
        for record in batch:
            inbox += _given(cast.part(record.frame), record, reader, found, stand_in)
        if standing is not None and standing.due(now):
            inbox += standing.say(now, Motion(here, here * 0.0))
        supervised.step(now if followed is None else followed.now() // 4 * 4, inbox)
        found.would += [(now, message) for message in companion.would]
        companion.would.clear()
        if companion.lacking:
            found.reasons[companion.lacking] += 1
        found.records += len(batch)
        on_step(now, found.records)
    found.holds = companion.tally.held
    return found


def steps(records: Iterable[Record]) -> Iterator[tuple[int, list[Record]]]:
    """Yield times (µs, multiples of 4) every 10 ms, each with the records since the previous one.

    The records are on one time line (see ``timeline``). Silences of more than 5 s are skipped, and so are
    records with an impossible time.
    """
    now: int | None = None
    batch: list[Record] = []
    for record in on_one_line(one for one in records if one.time < _INVALID_TIME_US):
        if now is None:
            now = record.time
        if record.time > now + IDLE:
            yield now, batch
            batch, now = [], record.time
        while record.time > now:
            yield now, batch
            batch = []
            now += STEP
        batch.append(record)
    if now is not None:
        yield now, batch


def _given(
    part: Part, record: Record, reader: Codec, found: ShadowRun, stand_in: _Substitute
) -> list[Datagram]:
    """Return the datagrams that the companion receives for a record.

    Set-points for the own vehicle and its local positions are collected in ``found``.
    """
    if part is Part.NOTHING:
        return []
    if part is Part.SENT:
        found.sent += [
            (record.time, m)
            for m in reader.feed(record.frame)
            if isinstance(m, SetpointLocal) and m.target_system in (0, stand_in.own.system)
        ]
        return []
    if part is not Part.AUTOPILOT:
        return [Datagram(part.value, record.frame)]
    given = [Datagram("autopilot", frame) for frame in stand_in.frames(record.frame)]
    for _, data in given:
        for message in reader.feed(data):
            if isinstance(message, LocalPosition) and message.source == stand_in.own:
                found.places.append((record.time, message.position_ned))
    return given


class _Substitute:
    """Substitute for messages of the own autopilot that the log may lack.

    It adds the origin, once, before the autopilot's first message. If the log has no LOCAL_POSITION_NED of
    the vehicle, it adds local positions derived from the global ones.
    """

    def __init__(self, own: int, seen: OwnRecords, fleet: FleetFrame) -> None:
        self.own = Source(own, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._local = None if seen.local else fleet
        self._codec = Codec()
        self._reader = Codec(
            lambda identifier, _system, _component: identifier == mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
        )
        latitude, longitude, altitude = seen.origin or (fleet.latitude, fleet.longitude, fleet.altitude)
        self._origin: Message | None = GpsGlobalOrigin(self.own, latitude, longitude, altitude, 0)

    def frames(self, frame: bytes) -> list[bytes]:
        """Return ``frame`` and the messages to add to it."""
        found = [frame]
        if self._origin is not None:
            found.insert(0, self._codec.encode(self._origin))
            self._origin = None
        position = mavlink.MAV_COMP_ID_AUTOPILOT1, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
        if self._local is not None and header(frame)[1:] == position:
            for message in self._reader.feed(frame):
                if isinstance(message, GlobalPosition):
                    place = enu_to_ned(
                        self._local.to_enu(message.latitude, message.longitude, message.altitude)
                    )
                    ned = (float(place[0]), float(place[1]), float(place[2]))
                    local = LocalPosition(self.own, message.time_boot, ned, message.velocity_ned)
                    found.append(self._codec.encode(local))
        return found
