"""Whoever orders hears what became of it; whoever only looks on says nothing in another's name; and who
follows another process is believed after it."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.dry_run import ONLOOKER, DryRun
from companion.node import Companion
from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.clocks.followed_clock import FollowedClock
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.key import Key
from mavlink_bridge.links.link import memory_pair
from mavlink_bridge.messages import CommandAck, CommandLong, GpsGlobalOrigin, Heartbeat, LocalPosition, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import EPOCH, Signing
from outrider.errors import InputError
from outrider.onboard.identify import Identification
from outrider.onboard.orders import OPERATOR, Orders, answered
from outrider.onboard.process_channel import intercom
from outrider.onboard.request import Request
from outrider.onboard.worker import Worker
from outrider.scenarios.fly_config import FleetOrigin, FlyConfig
from outrider.supervision.duplicate_ids import DuplicateIds
from outrider.supervision.supervised_node import SupervisedNode

ORIGIN = (47.4, 8.5, 488.0)
CONFIG = FlyConfig(system=1, target=100, origin=FleetOrigin(latitude=47.4, longitude=8.5, altitude=488.0))
VEHICLE = Source(1, 1)


@pytest.mark.parametrize("phase", [Phase.ESCORT, Phase.CONNECT], ids=lambda phase: phase.value)
def test_what_becomes_of_an_order_is_told(phase: Phase) -> None:
    desk, link = intercom()
    node = Companion(CONFIG.settings, 1, 100, FleetFrame(*ORIGIN), time.thread_time_ns)
    node.pilot.phase = phase
    desk.order(Orders(1, 5.0).frame("return"))
    inbox = [Datagram("ground", data) for data in link.receive()]
    for datagram in node.step(1_000, inbox):
        if datagram.link == "ground":
            link.send(datagram.data)
    (news,) = desk.news()
    assert (news["kind"], news["command"]) == ("ack", mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    text = answered(news["command"], news["result"], phase.value, "a heartbeat")
    taken = phase is Phase.ESCORT
    assert text == ("return: taken" if taken else "return: not taken: phase connect, waits for a heartbeat")
    desk.close()
    link.release()


def test_answers_to_others_are_none_of_ours() -> None:
    desk, link = intercom()
    link.send(
        Codec().encode(CommandAck(Source(1, COMPONENT), mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 255, 190 - 1))
    )
    link.send(b"garbage" + bytes(range(50)))
    assert list(desk.news()) == []
    link.send(
        Codec().encode(CommandAck(Source(1, COMPONENT), mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 1, OPERATOR))
    )
    assert len(list(desk.news())) == 1
    desk.close()
    link.release()


@given(
    st.lists(
        st.sampled_from(
            [mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, 511]
        ),
        max_size=5,
    )
)
def test_a_dry_run_speaks_in_nobodys_name(orders: list[int]) -> None:
    """The companion may be there as well, and be the one that is asked."""
    node = DryRun(CONFIG.settings, 1, 100, FleetFrame(*ORIGIN), time.thread_time_ns)
    clock = SimulatedClock(1_000_000)
    supervised = SupervisedNode(node, clock, FollowedClock(clock), None)
    codec, said = Codec(), []
    for k in range(200):
        stamp = 5_000_000 + 10_000 * k
        received = [Heartbeat(VEHICLE, 2, 3, 0, 0, 3)] if k % 100 == 0 else []
        received.append(GpsGlobalOrigin(VEHICLE, *ORIGIN, stamp))
        received.append(LocalPosition(VEHICLE, stamp, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)))
        inbox = [Datagram("autopilot", codec.encode(message)) for message in received]
        if k == 150:
            asked = [CommandLong(Source(255, 190), 1, COMPONENT, order, 0, (5.0,) * 7) for order in orders]
            inbox += [Datagram("ground", codec.encode(order)) for order in asked]
        for datagram in supervised.step(clock.now(), inbox):
            said += Codec().feed(datagram.data)
        clock.wait_until(clock.now() + 10_000)
    assert any(isinstance(message, Heartbeat) for message in said)
    assert any(isinstance(message, CommandLong) for message in said)
    assert {tuple(message.source) for message in said} == {(1, ONLOOKER)}
    assert not any(isinstance(message, CommandAck) for message in said)


def test_an_autopilot_may_boot_after_others() -> None:
    own, far = memory_pair()
    known = Identification(own, "udpin:…", Source(1, COMPONENT), None)
    other, beat = Heartbeat(Source(7, 1), 2, 3, 0, 0, 3), Heartbeat(VEHICLE, 2, 3, 0, 0, 3)
    codec = Codec()
    for second in range(40):
        far.send(codec.encode(other))
        assert known.look(second * 1_000_000) is None
        assert second == 0 or "heard there: 7" in known.waiting
    far.send(codec.encode(beat))
    assert known.look(40_000_000) == beat
    never = Identification(own, "udpin:…", Source(2, COMPONENT), None)
    far.send(codec.encode(other))
    assert never.look(0) is None
    with pytest.raises(InputError, match=r"heard there: 7 .*allowed"):
        never.look(100_000_000)


def test_who_follows_a_process_signs_after_it() -> None:
    """A simulation's time, and with it the stamps, may have run ahead of the wall's by hours."""
    key = Key(bytes(range(32)))
    desk, link = intercom()
    worker = Worker(Request(CONFIG, "px4", {}, key=key), {}, DuplicateIds(1, SimulatedClock(1)), link, Path())
    before, ear = Signing(key), Codec(None, Signing(key))
    before.present(EPOCH + 7_200_000_000)
    beat = Heartbeat(Source(1, COMPONENT), 18, 8, 0, 0, 4)
    assert ear.feed(Codec(None, before).encode(beat)) == [beat]
    worker.resume(before.newest)
    (said,) = [d for d in worker.companion.step(EPOCH, []) if d.link == "autopilot"]
    assert ear.feed(said.data)
    desk.close()
    link.release()
