"""Floods, garbage, forgeries, and clients that ask and are never heard of again: a vehicle flies as if nobody
else were there, tells others what it always tells, and remembers nothing of them."""

from __future__ import annotations

import gc
import math
import tracemalloc
from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge import messages as m
from mavlink_bridge.key import Key
from mavlink_bridge.messages import CommandAck, CommandLong, Source
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.packing import LONGEST
from mavlink_bridge.wire.signing import Refusal, Signing
from tests.sitl.autopilot_rig import FLAVOURS, Rig
from tests.sitl.hostile import ASKED, STRANGER, command, crowd, flood, garbage, orders, received
from tests.sitl.mission_client import LAND, TAKEOFF, at, count, item, upload
from tests.sitl.outside_client import Client

ME = Source(255, 190)
ASK = Codec().encode(CommandLong(ME, 11, 1, 520, 0, (0.0,) * 7))
TOLD = (m.Heartbeat, m.LocalPosition, m.GlobalPosition, m.Attitude, m.VfrHud, m.BatteryStatus)
GROWTH = 40_000
"""Bytes: less than 20 for each message, be it one that makes up a name, a number or a sender."""
KEY = Key.of_passphrase("correct horse")
NAN = math.nan


def on_a_mission(flavour: str, **more: Any) -> Rig:
    """A second after the takeoff that begins a mission."""
    rig = Rig(flavour, streams="normal", **more)
    client = Client(rig)
    signing = rig.autopilot._endpoint.signing
    if signing is not None:
        client.peer.signing.secret_key, client.peer.signing.sign_outgoing = bytes(KEY), True
    client.wait(1.2)
    plan = [at(0, 0, 0), at(0, 0, 3, TAKEOFF), at(12, 0, 3), at(12, 8, 4), at(0, 0, 3, LAND)]
    assert upload(client, plan if flavour == "ardupilot" else plan[1:]) == 0
    if flavour == "ardupilot":
        assert client.command(176, 1, 4) == 0
        assert client.command(400, 1) == 0
    assert client.command(300) == 0
    client.wait(1.0)
    return rig


def path(rig: Rig, steps: Iterable[list[bytes]]) -> Any:
    """Where it is after each step."""
    return np.array([rig.autopilot.state.position for _ in steps])


# Floods


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_mission_is_flown_as_if_nobody_asked_anything(flavour: str) -> None:
    quiet, busy = on_a_mission(flavour), on_a_mission(flavour)
    expected = path(quiet, flood(quiet, [], 12.0))
    np.testing.assert_array_equal(path(busy, flood(busy, crowd(), 12.0)), expected)
    assert np.ptp(expected[:, 0]) > 10.0


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_flood_takes_no_telemetry_from_others_and_no_answer_either(flavour: str) -> None:
    quiet, busy = (Rig(flavour, streams="normal", start_height=5.0) for _ in range(2))
    kinds = [kind for kind in ASKED if kind not in ("messages", "rates")]
    expected = [Counter(map(type, received(sent, TOLD))) for sent in flood(quiet, [], 3.0, ASK)]
    steps = list(flood(busy, crowd(kinds=kinds), 3.0, ASK))
    assert [Counter(map(type, received(sent, TOLD))) for sent in steps] == expected
    for sent in steps:
        acks = [ack for ack in received(sent, CommandAck) if (ack.target_system, ack.target_component) == ME]
        assert [ack.command for ack in acks] == [520]
        assert all(len(data) <= LONGEST for data in sent)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*ASKED, "everything"])
def test_nothing_of_a_flood_is_kept(kind: str) -> None:
    """Two thousand more of them, each another, leave no more behind than those before."""
    rig = Rig(("ardupilot", "px4")[len(kind) % 2], streams="normal", start_height=5.0, signing_setup="obeyed")
    data = crowd(6_000, tuple(ASKED) if kind == "everything" else (kind,))
    # Memory from before the trace counts when it is used again, until a collection gives it back: so two
    # parts come before the one that is measured.
    tracemalloc.start()
    try:
        traced = []
        for part in range(3):
            for _ in flood(rig, data[2_000 * part : 2_000 * (part + 1)], 0.2):
                pass
            gc.collect()
            traced.append(tracemalloc.get_traced_memory()[0])
        grown = traced[2] - traced[1]
    finally:
        tracemalloc.stop()
    assert grown < GROWTH
    assert rig.autopilot._communication._outbox == []


def test_what_one_datagram_asks_beyond_measure_is_refused_visibly_and_in_nobodys_way() -> None:
    rig = Rig(start_height=5.0)
    (sent,) = flood(rig, [], 0.005, b"".join(crowd(900, ("pings",))), ASK)
    assert len(received(sent, m.Ping)) == 256
    assert [text.text for text in received(sent, m.StatusText)] == ["Requests refused: 644 of one datagram"]
    assert len(received(sent, CommandAck)) == 1


@pytest.mark.parametrize("kind", ["pings", "unknown commands"])
def test_each_request_of_a_datagram_that_fits_an_ethernet_frame_is_answered(kind: str) -> None:
    rig, pieces, count = Rig(start_height=5.0), crowd(200, (kind,)), 0
    while sum(map(len, pieces[: count + 1])) <= 1472:
        count += 1
    assert count > 32
    (sent,) = flood(rig, [], 0.005, b"".join(pieces[:count]))
    assert len(received(sent, {"pings": m.Ping, "unknown commands": CommandAck}[kind])) == count


def test_complaints_are_told_of_some_and_not_of_thousands() -> None:
    rig = Rig("px4", start_height=5.0)
    texts = []
    data = crowd(5_000, ("unknown commands", "unknown parameters", "settings of unknown parameters"))
    for sent in flood(rig, data, 3.0):
        texts += received(sent, m.StatusText)
    assert 3 <= len(texts) <= 4 * 32


# Transfers


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_list_comes_to_its_end_however_often_others_begin_one(flavour: str) -> None:
    rig = Rig(flavour)
    numbers: set[int] = set()
    total = len(rig.autopilot._settings.values)
    for sent in flood(rig, crowd(2_000, ("lists of parameters",)), 1.0):
        numbers |= {value.number for value in received(sent, m.ParamValue)}
    assert numbers - {0xFFFF} == set(range(total))


def test_who_asks_for_a_list_while_one_goes_out_gets_a_whole_one() -> None:
    rig = Rig("ardupilot")
    ask = Codec().encode(m.ParamRequestList(ME, 11, 1))
    total = len(rig.autopilot._settings.values)
    list(flood(rig, [], 0.005, ask))
    list(flood(rig, [], 0.1))
    values = [value.number for sent in flood(rig, [], 0.005, ask) for value in received(sent, m.ParamValue)]
    values += [value.number for sent in flood(rig, [], 2.0) for value in received(sent, m.ParamValue)]
    assert set(values) == set(range(total))
    assert len(values) < 2 * total
    assert [value for sent in flood(rig, [], 1.0) for value in received(sent, m.ParamValue)] == []


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_plans_that_never_come_are_given_up_and_leave_the_old_one(flavour: str) -> None:
    rig = Rig(flavour)
    mine = Client(rig)
    mine.wait(0.1)
    plan = [at(0, 0, 0), at(0, 0, 3, TAKEOFF), at(5, 0, 3)]
    assert upload(mine, plan) == 0
    before = rig.autopilot.saved.plans
    for number in range(3):
        stranger = Client(rig, (200 + number, 1))
        stranger.send(count(700))
        for seq in range(number):
            stranger.send(item(plan[0], seq))
        # Busy as long as somebody may still be sending, and then free.
        assert upload(mine, plan) == 14
        mine.wait(6.0)
        assert rig.autopilot.saved.plans == before
    assert upload(mine, plan[:2]) == 0


# Garbage


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_garbage_changes_nothing_and_holds_up_nobody(flavour: str) -> None:
    quiet, busy = on_a_mission(flavour), on_a_mission(flavour)
    expected = path(quiet, flood(quiet, [], 4.0))
    for seed in range(2):
        for here, sent in zip(expected[400 * seed :], flood(busy, garbage(seed), 2.0, ASK), strict=False):
            acks = [
                ack for ack in received(sent, CommandAck) if (ack.target_system, ack.target_component) == ME
            ]
            assert [ack.command for ack in acks] == [520]
            np.testing.assert_array_equal(busy.autopilot.state.position, here)


# Forgeries


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("how", ["unsigned", "forged", "replayed", "touched"])
def test_nobody_without_the_key_ends_a_flight(flavour: str, how: str) -> None:
    quiet, attacked = (on_a_mission(flavour, signing=Signing(KEY)) for _ in range(2))
    expected = path(quiet, flood(quiet, [], 3.0))
    peer = dialect.MAVLink(None, 255, 190)
    signing = attacked.autopilot._endpoint.signing
    assert signing is not None
    if how == "forged":
        peer.signing.secret_key, peer.signing.sign_outgoing = b"x" * 32, True
        peer.signing.timestamp = signing.newest + 100
    elif how in ("replayed", "touched"):
        # As the pilot once said it, to this vehicle or to another with the key.
        peer.signing.secret_key, peer.signing.sign_outgoing = bytes(KEY), True
    data = [order.pack(peer) for order in orders()]
    if how == "touched":
        stamp = (signing.newest + 5_000).to_bytes(6, "little")
        data = [frame[:-12] + stamp + frame[-6:] for frame in data]
    np.testing.assert_array_equal(path(attacked, flood(attacked, data, 3.0)), expected)
    assert attacked.autopilot.armed
    reasons = {"unsigned": Refusal.UNSIGNED, "replayed": Refusal.OLD}
    assert signing.refused[reasons.get(how, Refusal.FORGED)] == 30_000
    assert sum(signing.refused.values()) == 30_000
    assert len(signing._streams) == 1


# Whatever is asked

USUAL = st.sampled_from([0.0, 1.0, -1.0, 2.0, 3.0, 4.0, 8.0, 30.0, 101.0, 148.0, 511.0, 9900.0, 2e4, 1e6])
EXTREME = USUAL | st.sampled_from([1e10, 3.4e38, -3.4e38, 1e-40, 65535.0, 65536.0, NAN, math.inf, -math.inf])
NUMBERS = st.sampled_from(
    [
        *(17, 20, 21, 22, 32, 115, 176, 178, 179, 185, 192, 193),
        *(207, 224, 245, 300, 400, 401, 410, 420, 510, 511, 512, 520),
    ]
)
PAUSE = st.sampled_from([0.005, 0.05, 0.5, 2.0])


@given(
    st.sampled_from(FLAVOURS),
    st.lists(st.tuples(NUMBERS, st.lists(EXTREME, max_size=7), PAUSE), min_size=1, max_size=12),
)
@settings(max_examples=150, deadline=None)
def test_no_order_and_no_sequence_of_orders_ends_the_autopilot(
    flavour: str, asked: list[tuple[int, list[float], float]]
) -> None:
    rig = Rig(flavour, start_height=5.0, streams="normal", failures="obeyed")
    for number, params, pause in asked:
        rig.run(pause)
        (sent,) = flood(rig, [], 0.005, Codec().encode(command(number, *params)))
        assert len([ack for ack in received(sent, CommandAck) if ack.command == number]) == 1
        assert np.isfinite(rig.autopilot.state.position).all()
    # The first two of these once were too much for it.
    for number, params in ((511, (30, 1e10)), (510, (30,)), (511, (30, 0)), (512, (30,))):
        (sent,) = flood(rig, [], 0.005, Codec().encode(command(number, *params)))
        assert received(sent, CommandAck)[-1].target_system == STRANGER.system
