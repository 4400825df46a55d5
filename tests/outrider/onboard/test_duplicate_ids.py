"""Two with one system id never fly beside each other unknown: another who speaks with the own ids is found,
and no go is taken; what comes back of the own words is nobody."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.dry_run import DryRun
from companion.flight.readiness import OPERATORS_GO
from companion.node import Companion
from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.key import Key
from mavlink_bridge.links.demultiplexer import Demultiplexer
from mavlink_bridge.links.link import memory_pair
from mavlink_bridge.messages import (
    CommandAck,
    CommandLong,
    GlobalPosition,
    Heartbeat,
    Message,
    Source,
    StatusText,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.header import Header
from mavlink_bridge.wire.signing import Signing
from outrider.onboard.orders import Orders
from outrider.onboard.status import StatusReports
from outrider.onboard.transmit_statistics import TransmitStatistics
from outrider.scenarios.fly_config import FleetOrigin, FlyConfig
from outrider.supervision.duplicate_ids import REMEMBERED, DuplicateIds
from outrider.supervision.supervised_node import CLOCK, DUPLICATE, SupervisedNode
from outrider.supervision.takeoff_inhibit import TakeoffInhibit
from tests.companion.bench import FLEET, PROFILES, START, SYSTEM, TARGET, TICK, PerfectAutopilot

SECOND = 1_000_000
OWN = Source(1, COMPONENT)
CONFIG = FlyConfig(system=1, target=100, origin=FleetOrigin(latitude=47.4, longitude=8.5, altitude=488.0))


class Air:
    """A swarm link on which the own words come back, as on a multicast group, and others may speak."""

    def __init__(self) -> None:
        self.clock = SimulatedClock(SECOND)
        self.duplicates = DuplicateIds(1, self.clock)
        own, self.far = memory_pair()
        demultiplexer = Demultiplexer(own, {"swarm": lambda _header: True}, self.duplicates)
        self.end = demultiplexer.ends["swarm"]
        self._codec, self._other = Codec(), Codec()

    def pass_by(self, seconds: float, source: Source | None = None) -> None:
        """Let them speak five times a second; ``source``: another one."""
        for _ in range(round(5 * seconds)):
            self.end.send(self._codec.encode(self.position(OWN)))
            for data in self.far.receive():
                self.far.send(data)
            if source is not None:
                self.far.send(self._other.encode(self.position(source)))
            self.end.receive()
            self.clock.wait_until(self.clock.now() + 200_000)

    def position(self, source: Source) -> GlobalPosition:
        since = self.clock.now() + (0 if source is OWN else 77_000)
        return GlobalPosition(source, since, 47.4, 8.5, 500.0, 12.0, (0.0, 0.0, 0.0), None)


@pytest.mark.parametrize(
    ("source", "found"),
    [(None, False), (Source(1, COMPONENT), True), (Source(2, COMPONENT), False), (Source(1, 1), False)],
    ids=["nobody", "a twin", "a neighbour", "the own autopilot"],
)
def test_who_speaks_with_the_own_ids_is_found(source: Source | None, found: bool) -> None:
    air = Air()
    air.pass_by(30.0)
    assert not air.duplicates.seen
    air.pass_by(4.0, source)
    assert air.duplicates.seen == found
    air.pass_by(20.0)
    assert not air.duplicates.seen


def test_what_is_said_again_is_remembered_as_long_as_what_is_new() -> None:
    air = Air()
    codec = Codec()
    again = codec.encode(air.position(OWN))
    air.duplicates.said(again)
    for k in range(2 * REMEMBERED):
        air.duplicates.said(codec.encode(air.position(OWN)._replace(altitude=0.01 * k)))
        if k % (3 * REMEMBERED // 4) == 0:
            air.duplicates.said(again)
            latest = k
        if k == latest + REMEMBERED // 2:
            # It comes back: for two seconds, as often as one likes.
            for _ in range(30):
                air.duplicates.received(Header(*OWN, 33), again)
                air.clock.wait_until(air.clock.now() + 100_000)
            assert not air.duplicates.seen


def test_what_was_said_before_this_process_and_comes_late_is_nobody() -> None:
    air = Air()
    air.pass_by(1.0, OWN)
    air.pass_by(1.0)
    assert not air.duplicates.seen


@pytest.mark.parametrize(
    ("sender", "found"),
    [("unsigned", False), ("another key", False), ("recorded", False), ("the key", True)],
)
def test_on_a_signed_link_only_holders_of_the_key_count(sender: str, found: bool) -> None:
    """A stranger blocks no go with the own ids, nor with own frames from before the start or of long ago."""
    clock = SimulatedClock(1_700_000_000 * SECOND)
    key = Key.of_passphrase("ours")
    duplicates = DuplicateIds(1, clock, key)
    signed = {"another key": Key.of_passphrase("theirs"), "unsigned": None}.get(sender, key)
    own, theirs = Signing(key), Signing(signed)
    mine, other = Codec(signing=own), Codec(signing=theirs)
    recorded = []
    for k in range(20):
        own.present(clock.now() - 20 * SECOND)
        recorded.append(mine.encode(heartbeat(k)))
    for k in range(2 * REMEMBERED):
        own.present(clock.now() + k * 100)
        frame = mine.encode(heartbeat(k))
        recorded.append(frame)
        duplicates.said(frame)
    clock.wait_until(clock.now() + 60 * SECOND)
    for k in range(20):
        theirs.present(clock.now())
        long_ago = recorded[k if k < 10 else REMEMBERED // 2 + k]
        duplicates.received(Header(*OWN, 0), long_ago if sender == "recorded" else other.encode(heartbeat(k)))
        clock.wait_until(clock.now() + SECOND // 2)
    assert duplicates.seen == found


@pytest.mark.parametrize(
    ("pace", "reported"), [(1.0, True), (0.0, False), (-1.0, False)], ids=["a twin", "one frame", "backwards"]
)
@pytest.mark.parametrize("behind", [5.0, 3600.0])
def test_a_signed_twin_whose_clock_is_behind_is_reported_and_bars_no_go(
    pace: float, reported: bool, behind: float
) -> None:
    """A stranger who plays a recording looks the same, and may not block the go."""
    clock, key = SimulatedClock(1_700_000_000 * SECOND), Key.of_passphrase("ours")
    duplicates, theirs = DuplicateIds(1, clock, key), Signing(key)
    other, began, frames = Codec(signing=theirs), clock.now(), []
    for k in range(8):
        theirs.present(began - round(behind * SECOND) + k * SECOND // 2)
        frames.append(other.encode(heartbeat(k)))
    if pace <= 0.0:
        frames = frames[:1] * 8 if pace == 0.0 else frames[::-1]
    for frame in frames:
        duplicates.received(Header(*OWN, 0), frame)
        clock.wait_until(clock.now() + SECOND // 2)
    assert duplicates.behind == reported
    assert not duplicates.seen
    clock.wait_until(clock.now() + 11 * SECOND)
    assert not duplicates.behind


def heartbeat(mode: int) -> Heartbeat:
    return Heartbeat(OWN, 18, 8, 0, mode, 4)


@pytest.mark.parametrize("kind", [Companion, DryRun])
def test_a_dry_run_beside_the_companion_is_no_alarm(kind: type[Companion]) -> None:
    """It has ids of its own."""
    air = Air()
    settings = CompanionConfig.model_validate({"ground_messages": {"texts": True}})
    node = kind(settings, 1, 100, FleetFrame(47.4, 8.5, 488.0), time.thread_time_ns)
    supervised = SupervisedNode(node, air.clock, None, None, air.duplicates)
    told: list[dict[str, object]] = []
    departures = TransmitStatistics(settings.limits)
    news = StatusReports(supervised, departures, None, None, lambda **one: told.append(one))
    said: list[Message] = []
    for _ in range(50):
        air.pass_by(0.2, OWN._replace())
        said += [m for d in supervised.step(air.clock.now(), []) for m in Codec().feed(d.data)]
        news.look(air.clock.now(), air.clock.now())
    assert air.duplicates.seen
    alarm = kind is Companion
    assert bool(supervised.barred) == alarm
    assert any(one.get("what") == "critical" for one in told) == alarm
    assert any(isinstance(message, StatusText) for message in said) == alarm


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside a twin"])
def test_a_go_that_waits_ends_where_a_twin_is_found(beside: bool) -> None:
    """It was given before anybody knew."""
    wall = SimulatedClock(START)
    duplicates = DuplicateIds(SYSTEM, wall)
    settings = CompanionConfig.model_validate({"task": "goto"})
    node = Companion(settings, SYSTEM, TARGET, FLEET, time.thread_time_ns)
    supervised, autopilot = (
        SupervisedNode(node, wall, None, None, duplicates),
        PerfectAutopilot(PROFILES["px4"], (0, 0, 0)),
    )
    go = Datagram("ground", Orders(SYSTEM, 5.0).frame("go"))
    own, header = Source(SYSTEM, COMPONENT), Header(SYSTEM, COMPONENT, 33)
    back, answers, codec = b"", [], Codec()
    autopilot.mute = True
    for tick in range(900):
        now = wall.now()
        if beside and tick % 20 == 0:
            said = GlobalPosition(own, tick, 47.4, 8.5, 500.0, 12.0, (0.0, 0.0, 0.0), None)
            duplicates.received(header, codec.encode(said))
        # Not ready for want of a position until the twin is known, and ready then.
        autopilot.mute = tick < 400
        inbox = [Datagram("autopilot", autopilot.step(now, back)), *([go] if tick == 100 else [])]
        told = supervised.step(now, inbox)
        back = b"".join(datagram.data for datagram in told if datagram.link == "autopilot")
        said_back = [m for d in told if d.link == "ground" for m in Codec().feed(d.data)]
        answers += [message.result for message in said_back if isinstance(message, CommandAck)]
        wall.wait_until(now + TICK)
    assert answers == [0]
    assert autopilot.armed != beside
    assert (node.pilot.phase is Phase.CONNECT) == beside
    if beside:
        # Nor is it obeyed when the other has fallen silent.
        wall.wait_until(wall.now() + 20 * SECOND)
        for _ in range(300):
            told = supervised.step(wall.now(), [Datagram("autopilot", autopilot.step(wall.now(), back))])
            back = b"".join(datagram.data for datagram in told if datagram.link == "autopilot")
            wall.wait_until(wall.now() + TICK)
        assert not supervised.barred
        assert node.pilot.waiting_for == OPERATORS_GO


def order(command: int, system: int = 1, component: int = COMPONENT) -> CommandLong:
    return CommandLong(Source(255, 190), system, component, command, 0, (0.0,) * 6 + (5.0,))


@given(
    st.lists(
        st.tuples(
            st.sampled_from([mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_LAND, 511]),
            st.sampled_from([1, 2]),
            st.sampled_from([1, COMPONENT]),
        ),
        max_size=6,
    ),
    st.binary(max_size=20),
)
def test_a_closed_gate_keeps_goes_and_nothing_else(
    orders: list[tuple[int, int, int]], garbage: bytes
) -> None:
    codec, messages = Codec(), [order(*one) for one in orders]
    data = b"".join(codec.encode(message) for message in messages)
    inbox = [Datagram("swarm", data), Datagram("ground", data + garbage)]
    passed, answers = TakeoffInhibit(1, None).closed(inbox)
    goes = [one for one in orders if one == (mavlink.MAV_CMD_NAV_TAKEOFF, 1, COMPONENT)]
    rest = [
        m
        for m in messages
        if (m.command, m.target_system, m.target_component) != (mavlink.MAV_CMD_NAV_TAKEOFF, *OWN)
    ]
    assert passed[0] == inbox[0]
    assert Codec().feed(passed[1].data.removesuffix(garbage)) == rest
    assert passed[1].data.endswith(garbage)
    denied = [message for datagram in answers for message in Codec().feed(datagram.data)]
    assert denied == [CommandAck(OWN, mavlink.MAV_CMD_NAV_TAKEOFF, 2, 0, 0, 255, 190)] * len(goes)


def test_no_go_is_taken_before_the_clock_is_known_nor_beside_a_twin() -> None:
    air = Air()
    node = Companion(CONFIG.settings, 1, 100, FleetFrame(47.4, 8.5, 488.0), time.thread_time_ns)
    node.pilot.phase = Phase.HOLD
    go = Datagram("ground", Orders(1, 5.0).frame("go"))

    def taken(supervised: SupervisedNode) -> bool:
        node.pilot.phase = Phase.HOLD
        told = supervised.step(air.clock.now(), [go])
        (answer,) = [
            m for d in told if d.link == "ground" for m in Codec().feed(d.data) if isinstance(m, CommandAck)
        ]
        assert (answer.result == 0) == (node.pilot.phase is Phase.ESCORT)
        return answer.result == 0

    young = SupervisedNode(node, air.clock, FollowedClock(air.clock, simulated=None), None, air.duplicates)
    assert (young.barred, taken(young)) == (CLOCK, False)
    supervised = SupervisedNode(node, air.clock, None, None, air.duplicates)
    assert (supervised.barred, taken(supervised)) == ("", True)
    air.pass_by(5.0, OWN._replace())
    assert (supervised.barred, taken(supervised)) == (DUPLICATE, False)
    air.pass_by(20.0)
    assert (supervised.barred, taken(supervised)) == ("", True)
