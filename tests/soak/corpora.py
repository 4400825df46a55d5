"""Good bytes to begin with: a frame of every message that the bridge knows, in both versions; plans; logs."""

from __future__ import annotations

import gzip
import math
from collections.abc import Sequence
from random import Random
from struct import pack as stamp
from typing import NamedTuple

from mavlink_bridge import messages as m
from mavlink_bridge.key import Key
from mavlink_bridge.messages import (
    BY_ID,
    BY_TYPE,
    Attitude,
    CommandAck,
    CommandInt,
    CommandLong,
    EkfStatus,
    ExtendedSysState,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Message,
    Ping,
    PositionTarget,
    SetpointLocal,
    Source,
    StatusText,
    SysStatus,
    SystemTime,
    Timesync,
    Tunnel,
)
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.agreements import pack as pack_statement
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, WirePlan, pack, quantise
from outrider.resources import config_root
from tests.mavlink_bridge.recorded_logs import PIECES

AUTOPILOT, COMPANION, NEIGHBOUR = Source(11, 1), Source(11, 195), Source(12, 195)
TARGET, GROUND = Source(1, 1), Source(255, 190)
CAMERA = Source(11, 100)
LATITUDE, LONGITUDE, ALTITUDE = 47.397742, 8.545594, 488.0
NOW = 1_767_225_600_000_000
ZERO = (0.0, 0.0, 0.0)
NAN = math.nan
_LOG_RECORDS = 60


class Known(NamedTuple):
    """A good message, and where a companion hears it: ``autopilot``, ``swarm``, ``target`` or ``ground``."""

    link: str
    message: Message


def plan(fingerprint: int, epoch: int = NOW) -> Tunnel:
    """A neighbour's plan, 3 m away and on its way."""
    knots = [[0.5, -0.5, 0.1]] * 16
    wire = quantise(epoch, 100_000, [3.0, 0.0, 5.0], [-1.0, 0.5, 0.0], knots, fingerprint)
    return Tunnel(NEIGHBOUR, 0, 0, PAYLOAD_TYPE, pack(wire))


def scan(boot: int) -> m.ObstacleDistance:
    """A wall ahead, nothing beside it, and half a circle that is not looked at."""
    distances = (4.0, 4.1, 4.3, *[20.01] * 30, *[None] * 39)
    return m.ObstacleDistance(AUTOPILOT, boot, 0, distances, math.radians(5.0), 0.2, 20.0, 0.0, 12)


def agreements(checksum: int, epoch: int = NOW) -> Tunnel:
    """A neighbour's statement of its agreements, with an entry of each form."""
    now, before = (epoch, epoch), (epoch - 200_000, epoch)
    entries = Entry(11, (now,), now), Entry(13, (before,), now), Entry(14, departed=True)
    return Tunnel(NEIGHBOUR, 0, 0, AGREEMENTS, pack_statement(Statement(checksum, epoch, epoch, entries)))


def absurd_plan(random: Random, fingerprint: int, epoch: int) -> Tunnel:
    """A plan that fits the wire and no vehicle: numbers at the ends of their ranges, steps of any length, or
    some of its bytes lost or changed."""

    def three(bits: int) -> tuple[int, int, int]:
        low, high = -(1 << bits - 1), (1 << bits - 1) - 1
        x, y, z = (random.choice((low, high, 0, 1, random.randint(low, high))) for _ in range(3))
        return x, y, z

    wire = WirePlan(
        random.choice((epoch, epoch, epoch, 0, (1 << 56) - 1, epoch - 400_000, epoch + 60_000_000)),
        4 * random.choice((1, 25_000, 25_000, 0xFFFF, random.randint(1, 0xFFFF))),
        three(random.choice((8, 11, 32))),
        three(random.choice((8, 11, 24))),
        tuple(three(16) for _ in range(random.randint(0, 16))),
        fingerprint,
    )
    data = pack(wire)
    if random.random() < 0.3:
        at = random.choice((0, 2, 4, random.randrange(len(data))))
        data = data[:at] + random.choice((b"\0\0", b"\xff\xff", b"")) + data[at + 2 :]
    return Tunnel(NEIGHBOUR, 0, 0, PAYLOAD_TYPE, data[:128])


def messages(checksum: int = 0, now: int = NOW) -> tuple[Known, ...]:
    """Of every row of the table at least one, with values as in a flight at ``now`` (µs)."""
    place = LATITUDE, LONGITUDE, ALTITUDE + 5.0
    boot = now - NOW
    me = 11, 1
    found = (
        Known("autopilot", Heartbeat(AUTOPILOT, 2, 3, 0x89, 4, 4)),
        Known("autopilot", SysStatus(AUTOPILOT, 0x10000000, 0x10000000, 0x10000000, 12.1, 0.9)),
        Known("autopilot", SystemTime(AUTOPILOT, now, boot)),
        Known("autopilot", Ping(GROUND, now, 7, 0, 0)),
        Known("autopilot", Attitude(AUTOPILOT, boot, 0.01, -0.02, 1.5, (0.0, 0.1, 0.2))),
        Known("autopilot", LocalPosition(AUTOPILOT, boot, (0.1, 0.2, -5.0), (0.0, 0.1, 0.0))),
        Known("swarm", GlobalPosition(NEIGHBOUR, boot, *place, 5.0, (0.5, 0.0, 0.0), 1.0)),
        Known("target", GlobalPosition(TARGET, boot, *place, 5.0, (0.0, 1.0, 0.0), None)),
        Known("autopilot", GpsGlobalOrigin(AUTOPILOT, LATITUDE, LONGITUDE, ALTITUDE, 1)),
        Known(
            "ground",
            CommandInt(
                GROUND, 11, 195, 0, 192, (-1.0, 0.0, 0.0, NAN), round(LATITUDE * 1e7), 85_455_940, 493.0
            ),
        ),
        Known("ground", CommandInt(GROUND, *me, 0, 22, (0.0, 0.0, 0.0, NAN), 0, 0, 5.0)),
        Known("ground", CommandLong(GROUND, 11, 195, 22, 0, (0.0, 0.0, 0.0, NAN, NAN, NAN, 5.0))),
        *(
            Known("ground", CommandLong(GROUND, *me, command, 0, params))
            for command, params in (
                (176, (1.0, 4.0, *[0.0] * 5)),
                (176, (1.0, 6.0, *[0.0] * 5)),
                (400, (1.0, *[0.0] * 6)),
                (22, (*[NAN] * 6, 5.0)),
                (511, (30.0, 20_000.0, *[0.0] * 5)),
                (512, (49.0, *[0.0] * 6)),
                (17, (0.0,) * 7),
                (32, (42.0, *[0.0] * 6)),
                (115, (90.0, 0.0, 1.0, *[0.0] * 4)),
                (178, (1.0, 3.0, *[0.0] * 5)),
                (192, (-1.0, 1.0, 0.0, NAN, LATITUDE, LONGITUDE, ALTITUDE + 5.0)),
                (193, (0.0,) * 7),
                (193, (1.0, *[0.0] * 6)),
                (401, (0.0,) * 7),
            )
        ),
        Known("autopilot", CommandAck(AUTOPILOT, 400, 0, 0, 0, 11, 195)),
        *(
            Known(
                "autopilot",
                SetpointLocal(
                    COMPANION, 0, *me, frame, mask, (1.0, 2.0, -5.0), (0.5, 0.0, 0.0), ZERO, 0.5, 0.1
                ),
            )
            for frame, mask in ((1, 0x9F8), (1, 0x9C7), (1, 0x000), (8, 0xFC7), (9, 0xDF8), (1, 0xE3F))
        ),
        Known(
            "autopilot",
            m.SetpointGlobal(
                COMPANION, 0, *me, 6, 0x9F8, round(LATITUDE * 1e7), 85_455_940, 5.0, ZERO, ZERO, 0.5, 0.1
            ),
        ),
        Known("autopilot", m.SetpointAttitude(COMPANION, 0, *me, 7, (1.0, 0.0, 0.0, 0.0), ZERO, 0.5)),
        Known("autopilot", m.FollowTarget(TARGET, boot, *place, (1.0, 0.0, 0.0))),
        Known("autopilot", m.FenceStatus(AUTOPILOT, boot, True, 1, 3)),
        Known("autopilot", PositionTarget(AUTOPILOT, 0, 1, 0x9C0, (1.0, 2.0, -5.0), ZERO, ZERO, 0.5, 0.0)),
        Known("autopilot", Timesync(GROUND, 0, 123_456_789)),
        Known("autopilot", EkfStatus(AUTOPILOT, 0x3F)),
        Known("autopilot", ExtendedSysState(AUTOPILOT, 0, 2)),
        Known("autopilot", StatusText(AUTOPILOT, 4, "Arming refused: no position yet")),
        Known("autopilot", m.NamedValue(COMPANION, boot, "plan_ms", 3.5)),
        Known("autopilot", m.CameraTrackingGeo(CAMERA, 1, *place, (0.0, 1.0, 0.0))),
        Known("autopilot", m.CameraTrackingGeo(CAMERA, 1, *place, None, 0.7, 0.4, None, 9.0, 1.5, 0.01)),
        Known(
            "autopilot",
            m.CameraInformation(CAMERA, boot, "outrider", "any", 1, 4.0, (5.6, 3.15), (1280, 720), 0),
        ),
        Known("autopilot", m.CameraFovStatus(CAMERA, boot, place, None, (1.0, 0.0, 0.0, 0.0), 1.2, 0.8)),
        Known("autopilot", m.CameraTrackingImage(CAMERA, 1, 2, 4, None, None, (0.4, 0.3, 0.45, 0.6))),
        Known("autopilot", m.GimbalAttitude(Source(11, 154), boot, 44, (0.9, 0.0, -0.4, 0.0), None)),
        Known("autopilot", scan(boot)),
        Known(
            "swarm", m.AdsbVehicle(Source(11, 156), 0x4B1234, *place, True, 1.0, 60.0, 0.0, "HB", 1, 10**6)
        ),
        Known("swarm", plan(checksum & 0xFF, now)),
        Known("swarm", agreements(checksum, now)),
        *(Known("autopilot", message) for message in services()),
    )
    missing = {row.message for row in BY_ID.values()} - {type(known.message) for known in found}
    if missing:
        raise LookupError(f"no good message of {missing}")
    return found


def services() -> tuple[Message, ...]:
    """What a ground station asks, and what an autopilot answers: one of each."""
    me, ground = (11, 1), (255, 190)
    place = LATITUDE, LONGITUDE, ALTITUDE
    four = (1.0, 0.0, 0.0, 0.0)
    x, y = round(LATITUDE * 1e7) + 200, round(LONGITUDE * 1e7)
    takeoff, waypoint = (22, (0.0, 0.0, 0.0, NAN)), (16, (0.0, 2.0, 0.0, NAN))
    return (
        m.SetMode(GROUND, 4, 11, 1),
        m.ParamRequestRead(GROUND, -1, *me, "GUID_TIMEOUT"),
        m.ParamRequestList(GROUND, *me),
        m.ParamValue(AUTOPILOT, stamp("<f", 3.0), 200, 7, "GUID_TIMEOUT", 9),
        m.ParamSet(GROUND, stamp("<f", 2.0), *me, "GUID_TIMEOUT", 9),
        m.SetGpsGlobalOrigin(GROUND, *place, 11, 0),
        m.RequestDataStream(GROUND, 4, *me, 0, 1),
        m.FileTransfer(GROUND, 0, *me, bytes((1, 0, 0, 4, 5, *[0] * 7)) + b"/fs/a".ljust(239, b"\0")),
        m.AutopilotVersion(AUTOPILOT, 0xE0CF, 1, 0x040603FF, 0, 0, 0, 0, 0, *[bytes(8)] * 3, bytes(18)),
        m.HomePosition(AUTOPILOT, *place, ZERO, four, ZERO, 1),
        m.SetHomePosition(GROUND, *place, ZERO, four, ZERO, 11, 1),
        m.MessageInterval(AUTOPILOT, 20_000, 30),
        m.SetupSigning(GROUND, 36_000_000_000_000, *me, Key(bytes(range(32)))),
        m.MissionCount(GROUND, 2, *me, 0, 0),
        m.MissionItem(GROUND, takeoff[1], x, y, 6.0, 0, takeoff[0], *me, 6, 1, 1, 0),
        m.MissionItemFloat(GROUND, waypoint[1], *place[:2], 8.0, 1, waypoint[0], *me, 3, 0, 1, 0),
        m.MissionWritePartialList(GROUND, 1, 1, *me, 0),
        m.MissionRequestList(GROUND, *me, 0),
        m.MissionRequest(GROUND, 1, *me, 0),
        m.MissionRequestFloat(GROUND, 0, *me, 0),
        m.MissionSetCurrent(GROUND, 1, *me),
        m.MissionAck(GROUND, *me, 15, 0, 0),
        m.MissionClearAll(GROUND, *me, 255),
        m.MissionCurrent(AUTOPILOT, 1, 2, 3, 1, 5, 0, 0),
        m.MissionItemReached(AUTOPILOT, 1),
        m.GpsRaw(AUTOPILOT, 7, 3, *place, 0.7, 1.1, 0.2, 1.0, 10, ALTITUDE, 0.9, 1.8, 0.4),
        m.AttitudeQuaternion(AUTOPILOT, 7000, four, (0.0, 0.1, 0.2)),
        m.VfrHud(AUTOPILOT, 1.0, 1.0, ALTITUDE, 0.1, 2.0, 0.4),
        m.Altitude(AUTOPILOT, 7, 1.0, ALTITUDE, 1.0, 1.0, NAN, NAN),
        m.BatteryStatus(AUTOPILOT, 0, 1, 1, (12.4,), 11.0, 700.0, 0.9, 600, 1),
        m.RawImu(AUTOPILOT, 7, (0.0, 0.0, -9.80665), (0.0, 0.1, 0.2), (0.2, 0.0, 0.4)),
        m.HighresImu(AUTOPILOT, 7, (0.0, 0.0, -9.8), (0.0, 0.1, 0.2), (0.2, 0.0, 0.4), 960.0, 450.0, 25.0),
        m.SimState(AUTOPILOT, 0.0, 0.1, 0.2, (0.0, 0.0, -9.8), (0.0, 0.1, 0.2), *place[:2]),
        m.SimulationState(AUTOPILOT, *place, (1.0, -0.5, 0.1)),
        m.HilState(AUTOPILOT, 7, *place, (1.0, -0.5, 0.1)),
        m.EstimatorStatus(AUTOPILOT, 7, 0.1, 0.1, 0.1, 0.1, NAN, NAN, 0.3, 0.3, 831),
        m.MissionCount(AUTOPILOT, 2, *ground, 0, 5),
        *records(me, place, four),
    )


def records(
    me: tuple[int, int], place: tuple[float, float, float], four: tuple[float, float, float, float]
) -> tuple[Message, ...]:
    """Requests of logs and their answers, files' metadata, and what an autopilot aims at and puts out."""
    return (
        m.LogRequestList(GROUND, 0, 0xFFFF, *me),
        m.LogEntry(AUTOPILOT, 1_700_000_000, 5000, 1, 1, 1),
        m.LogRequestData(GROUND, 0, 5000, 1, *me),
        m.LogData(AUTOPILOT, 90, 1, bytes(range(90))),
        m.LogErase(GROUND, *me),
        m.LogRequestEnd(GROUND, *me),
        m.ComponentMetadata(AUTOPILOT, 7000, 0x1234, "mftp://etc/extras/component_general.json.xz"),
        m.AvailableMode(AUTOPILOT, 4, 0, 8, 3, 0, "GUIDED"),
        m.CurrentMode(AUTOPILOT, 4, 4, 0),
        m.AvailableModesMonitor(AUTOPILOT, 1),
        m.AttitudeTarget(AUTOPILOT, 7000, four, ZERO, 0.5, 7),
        m.PositionTargetGlobal(AUTOPILOT, 7000, *place, ZERO, ZERO, 0.5, 0.0, 0x9C0, 5),
        m.Odometry(AUTOPILOT, 7, (1.0, 2.0, -5.0), four, ZERO, ZERO, 1, 1, 0, 8),
        m.ServoOutput(AUTOPILOT, 7, 0, (1500,) * 6),
        m.ActuatorOutputs(AUTOPILOT, 7, (1500.0,) * 6),
        m.RcChannels(AUTOPILOT, 7000, (1500,) * 8, 255),
        m.ScaledImu(AUTOPILOT, 7000, (0.0, 0.0, -9.80665), (0.0, 0.1, 0.2), (0.2, 0.0, 0.4)),
        m.ScaledPressure(AUTOPILOT, 7000, 960.0, 25.0),
        m.FlightInformation(AUTOPILOT, 1, 2, 1, 7000, 0),
        m.UtmGlobalPosition(AUTOPILOT, 7, *place, 8.0, ZERO, (0.3, 0.4, 0.1), bytes(18), 3, 0x7F),
    )


def frames(known: Sequence[Known]) -> tuple[bytes, ...]:
    """Each in MAVLink 2, and in MAVLink 1 where there is one."""
    codec = Codec()
    v2 = [codec.encode(one.message) for one in known]
    v1 = [codec.encode_v1(one.message) for one in known if BY_TYPE[type(one.message)].id < 256]
    return (*v2, *v1)


def recorded() -> bytes:
    """The shipped log."""
    return (config_root() / "logs" / "escort-target.tlog").read_bytes()


def log(chosen: Sequence[bytes], records: int = _LOG_RECORDS) -> bytes:
    """A tlog of ``chosen`` frames in turn, 20 ms apart, over all four links."""
    times = range(NOW, NOW + 20_000 * records, 20_000)
    return b"".join(
        stamp(">Q", time | number % 4) + chosen[number % len(chosen)] for number, time in enumerate(times)
    )


def logs() -> tuple[bytes, ...]:
    """Whole logs: the shipped one, pieces of others with the damage of their own, synthetic ones, compressed
    ones."""
    mixed = log(frames(messages()))
    return (
        recorded(),
        recorded()[:1200],
        *(path.read_bytes() for path in PIECES),
        mixed,
        gzip.compress(mixed, mtime=0),
        gzip.compress(recorded(), mtime=0),
    )
