"""Plans go up and come down unchanged, whatever happens on the way; what is broken off changes nothing."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from sitl.autopilot.saved import Saved
from sitl.node import Autopilot
from tests.sitl.autopilot_rig import FIREFLY, FLAVOURS, SITE, Rig
from tests.sitl.mission_client import (
    DELAY,
    JUMP,
    LAND,
    MISSION_FRAME,
    RTL,
    SPEED,
    TAKEOFF,
    WAYPOINT,
    Way,
    acks,
    at,
    count,
    download,
    item,
    old_item,
    requests,
    upload,
    ways,
)
from tests.sitl.outside_client import Client, only

ACCEPTED, ERROR, BAD_FRAME, UNSUPPORTED, NO_SPACE, BAD_SEQUENCE, DENIED, CANCELLED = 0, 1, 2, 3, 4, 13, 14, 15
SQUARE = [
    at(0, 0, 5, TAKEOFF),
    at(10, 0, 5),
    Way(SPEED, params=(1.0, 3.0, -1.0, 0.0), frame=MISSION_FRAME),
    at(10, 10, 6, WAYPOINT, 2.0),
    Way(RTL, frame=MISSION_FRAME),
]
FENCE = [at(n, e, 0, 5001, 4.0) for n, e in ((50, 50), (50, -50), (-50, -50), (-50, 50))] + [
    at(20, 20, 0, 5004, 5.0)
]
RALLY = [at(5, 5, 10, 5100), at(-5, 5, 12, 5100)]

floats = st.floats(width=32, allow_infinity=False)
finite = st.floats(-1e4, 1e4, width=32)
placed = st.builds(
    Way,
    st.sampled_from((WAYPOINT, 17, 19)),
    st.integers(-900_000_000, 900_000_000),
    st.integers(-1_800_000_000, 1_800_000_000),
    finite,
    st.tuples(st.floats(0, 1000, width=32), floats, floats, floats),
    st.sampled_from((0, 3, 5, 6)),
)
plans = st.lists(placed, max_size=12)


def expected(plan: list[Way], of: int = 0) -> list[str]:
    """As pymavlink would read them back."""
    peer = dialect.MAVLink(None, 255, 190)
    packed = [item(way, seq, of).pack(peer) for seq, way in enumerate(plan)]
    return ways([dialect.MAVLink(None).decode(bytearray(data)) for data in packed])


@settings(max_examples=40, deadline=None)
@given(plan=plans, flavour=st.sampled_from(FLAVOURS))
def test_whatever_goes_up_comes_down_the_same(plan, flavour):
    client = Client(Rig(flavour))
    assert upload(client, plan) == ACCEPTED
    assert ways(download(client)) == expected(plan)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_three_plans_are_held_side_by_side_and_over_a_restart(flavour):
    client = Client(Rig(flavour))
    for of, plan in enumerate((SQUARE, FENCE, RALLY)):
        assert upload(client, plan, of) == ACCEPTED
    saved = Saved.model_validate_json(client.rig.autopilot.saved.model_dump_json())
    rig = Rig(flavour)
    rig.autopilot = Autopilot(rig.config, FIREFLY, SITE, seed=1, saved=saved)
    for where in (client, Client(rig)):
        for of, plan in enumerate((SQUARE, FENCE, RALLY)):
            assert ways(download(where, of)) == expected(plan, of)


def test_the_firmwares_ask_as_they_do():
    asked = [client.send(count(1))[0].get_type() for client in (Client(Rig(flavour)) for flavour in FLAVOURS)]
    assert asked == ["MISSION_REQUEST", "MISSION_REQUEST_INT"]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_old_messages_do_too(flavour):
    client = Client(Rig(flavour), v1=True)
    plan = [at(0, 0, 5, TAKEOFF), at(10, 0, 5), at(0, 4, 6)]
    assert upload(client, plan, make=old_item) == ACCEPTED
    for seq, way in [*enumerate(plan)][1:]:
        found = client.send(dialect.MAVLink_mission_request_message(11, 1, seq))
        message = only(found, "MISSION_ITEM")
        # A latitude in float32 is off by up to 2e-6 degrees, on either way.
        assert (message.x, message.y) == pytest.approx((way.x / 1e7, way.y / 1e7), abs=4e-6)
        assert (message.command, message.z, message.frame) == (way.command, way.z, 3)


REFUSED: list[tuple[Way, int, int]] = [
    (Way(9999), 0, UNSUPPORTED),
    (Way(5001, params=(3.0, 0.0, 0.0, 0.0)), 0, UNSUPPORTED),
    (at(0, 0, 5), 1, UNSUPPORTED),
    (at(0, 0, 5), 2, UNSUPPORTED),
    (at(0, 0, 5)._replace(frame=1), 0, BAD_FRAME),
    (at(0, 0, 5)._replace(frame=10), 0, BAD_FRAME),
    (at(0, 0, 5, WAYPOINT, -1.0), 0, 6),
    (at(0, 0, 5, WAYPOINT, math.inf), 0, 6),
    (Way(JUMP, params=(7.0, 1.0, 0.0, 0.0), frame=MISSION_FRAME), 0, 6),
    (Way(SPEED, params=(1.0, math.inf, 0.0, 0.0), frame=MISSION_FRAME), 0, 7),
    (at(0, 0, 5)._replace(x=900_000_001), 0, 10),
    (at(0, 0, 5)._replace(y=1_800_000_001), 0, 11),
    (at(0, 0, math.nan), 0, 12),
    (at(0, 0, 2e4), 0, 12),
    (at(0, 0, 0, 5001, 2.0), 1, 6),
    (at(0, 0, 0, 5001, 3.0), 1, 6),
    (at(0, 0, 0, 5003, 0.0), 1, 6),
]


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize(("way", "of", "result"), REFUSED)
def test_what_cannot_be_flown_is_refused_and_the_old_plan_stays(flavour, way, of, result):
    client = Client(Rig(flavour))
    old = (SQUARE, FENCE, RALLY)[of]
    assert upload(client, old, of) == ACCEPTED
    assert upload(client, [old[0], way] if of == 0 else [way], of) == result
    assert ways(download(client, of)) == expected(old, of)


def test_too_many_and_unknown_types_are_refused():
    client = Client(Rig())
    assert acks(client.send(count(10_000))) == [NO_SPACE]
    assert acks(client.send(count(1, 7))) == [UNSUPPORTED]
    assert acks(client.send(dialect.MAVLink_mission_request_list_message(11, 1, 9))) == [UNSUPPORTED]
    assert acks(client.send(dialect.MAVLink_mission_request_int_message(11, 1, 1, 0))) == [BAD_SEQUENCE]
    assert acks(client.send(item(SQUARE[0], 0))) == [DENIED]
    assert acks(client.send(count(0))) == [ACCEPTED]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_an_upload_that_stops_is_asked_for_again_and_given_up(flavour):
    client = Client(Rig(flavour))
    assert upload(client, SQUARE) == ACCEPTED
    client.send(count(3))
    client.send(item(SQUARE[0], 0))
    found = client.wait(7.0)
    asked = requests(found)
    assert set(asked) == {1}
    assert 5 <= len(asked) <= 12
    assert acks(found) == [CANCELLED]
    assert "Mission upload timed out" in client.texts
    assert ways(download(client)) == expected(SQUARE)
    assert requests(client.wait(3.0)) == []


def test_lost_and_repeated_messages_do_no_harm():
    client = Client(Rig())
    assert requests(client.send(count(len(SQUARE)))) == [0]
    assert requests(client.wait(0.6)) == [0]
    assert requests(client.send(item(SQUARE[0], 0))) == [1]
    assert requests(client.send(item(SQUARE[0], 0), item(SQUARE[3], 3))) == []
    assert requests(client.send(item(SQUARE[1], 1))) == [2]
    assert requests(client.wait(1.2)) == [2, 2]
    for seq in (2, 3):
        client.send(item(SQUARE[seq], seq))
    assert acks(client.send(item(SQUARE[4], 4))) == [ACCEPTED]
    assert ways(download(client)) == expected(SQUARE)


def test_an_upload_can_be_cancelled_and_another_begun():
    client = Client(Rig())
    upload(client, SQUARE)
    client.send(count(4))
    client.send(dialect.MAVLink_mission_ack_message(11, 1, CANCELLED, 0))
    assert requests(client.wait(6.0)) == []
    assert ways(download(client)) == expected(SQUARE)
    assert upload(client, SQUARE[:2]) == ACCEPTED


def test_one_uploads_at_a_time():
    rig = Rig()
    one, two = Client(rig), Client(rig, (254, 1))
    one.send(count(2))
    two.received.clear()
    two.send(count(1))
    assert DENIED in acks(two.received)
    one.send(item(SQUARE[0], 0))
    one.send(item(SQUARE[1], 1))
    assert ways(download(one)) == expected(SQUARE[:2])


@pytest.mark.parametrize("of", [0, 1, 2, 255])
def test_clearing(of):
    client = Client(Rig())
    for each, plan in enumerate((SQUARE, FENCE, RALLY)):
        upload(client, plan, each)
    assert acks(client.send(dialect.MAVLink_mission_clear_all_message(11, 1, of))) == [ACCEPTED]
    left = [bool(download(client, each)) for each in range(3)]
    assert left == [of not in (each, 255) for each in range(3)]


def test_a_part_can_be_replaced_in_ardupilot_only():
    partial = dialect.MAVLink_mission_write_partial_list_message(11, 1, 1, 2, 0)
    client = Client(Rig("ardupilot"))
    upload(client, SQUARE)
    new = [at(3, 3, 7), at(4, 4, 8)]
    assert requests(client.send(partial)) == [1]
    assert requests(client.send(item(new[0], 1))) == [2]
    assert acks(client.send(item(new[1], 2))) == [ACCEPTED]
    assert ways(download(client)) == expected([SQUARE[0], *new, *SQUARE[3:]])
    beyond = dialect.MAVLink_mission_write_partial_list_message(11, 1, 3, 9, 0)
    assert acks(client.send(beyond)) == [ERROR]
    assert acks(Client(Rig("px4")).send(partial)) == [UNSUPPORTED]


def opaque(data: bytes, message_id: int) -> int:
    """The extension field that pymavlink's dialect lacks: the last four bytes of the newest such frame."""
    found = 0
    while data:
        length, size = data[1], {44: 9, 47: 8}.get(data[7], 0)
        if data[7] == message_id:
            found = int.from_bytes(data[10 : 10 + length].ljust(size, b"\0")[-4:], "little")
        data = data[12 + length :]
    return found


def test_plans_have_names_that_say_whether_they_changed():
    client = Client(Rig())
    names = []
    for plan in (SQUARE, SQUARE[:3], SQUARE, []):
        upload(client, plan)
        names.append(opaque(client.rig.bytes, 47))
        client.send(dialect.MAVLink_mission_request_list_message(11, 1, 0))
        assert opaque(client.rig.bytes, 44) == names[-1]
    assert names[0] == names[2] != names[1]
    assert names[3] == 0
    assert 0 not in names[:3]


kinds, numbers = st.integers(0, 3), st.integers(0, 9)
any_way = st.sampled_from([*SQUARE, *FENCE, *RALLY, Way(DELAY), Way(LAND)])
us = st.just(11), st.just(1)
messages: st.SearchStrategy[Any] = st.one_of(
    st.builds(count, st.integers(0, 5), kinds),
    st.builds(item, any_way, st.integers(0, 5), kinds),
    st.builds(dialect.MAVLink_mission_request_list_message, *us, kinds),
    st.builds(dialect.MAVLink_mission_request_int_message, *us, numbers, kinds),
    st.builds(dialect.MAVLink_mission_ack_message, *us, st.integers(0, 15), kinds),
    st.builds(dialect.MAVLink_mission_clear_all_message, *us, st.sampled_from((0, 1, 2, 5, 255))),
    st.builds(dialect.MAVLink_mission_set_current_message, *us, numbers),
    st.builds(
        dialect.MAVLink_mission_write_partial_list_message,
        *us,
        st.integers(-3, 4),
        st.integers(-3, 6),
        kinds,
    ),
)


@settings(max_examples=80, deadline=None)
@given(said=st.lists(messages, max_size=25), flavour=st.sampled_from(FLAVOURS))
def test_in_whatever_order_a_plan_is_always_one_that_was_accepted(said, flavour):
    client = Client(Rig(flavour))
    for message in said:
        client.send(message)
    client.send(dialect.MAVLink_mission_ack_message(11, 1, CANCELLED, 0))
    for of in range(3):
        held = client.rig.autopilot.saved.plans[of]
        assert len(download(client, of)) == len(held)
        client.send(dialect.MAVLink_mission_ack_message(11, 1, CANCELLED, of))
        again = Autopilot(client.rig.config, FIREFLY, SITE, seed=1, saved=client.rig.autopilot.saved)
        assert repr(again.saved.plans) == repr(client.rig.autopilot.saved.plans)
    assert upload(client, SQUARE) == ACCEPTED
    assert ways(download(client)) == expected(SQUARE)


@pytest.mark.parametrize("uploaded", [False, True], ids=["no mission", "a mission"])
def test_item_0_is_home_on_an_arducopter_and_as_it_was_uploaded_on_a_px4(uploaded):
    """An ArduCopter's can always be read, also where there is no mission."""
    for flavour in FLAVOURS:
        client = Client(Rig(flavour))
        client.wait(1.2)
        if uploaded:
            assert upload(client, SQUARE) == ACCEPTED
        found = client.send(dialect.MAVLink_mission_request_int_message(11, 1, 0, 0))
        found += client.send(dialect.MAVLink_mission_request_message(11, 1, 0, 0))
        items = [m for m in found if m.get_type() in ("MISSION_ITEM_INT", "MISSION_ITEM")]
        if flavour == "px4":
            assert [(m.command, m.z) for m in items] == [(TAKEOFF, 5.0)] * 2 * uploaded
            assert acks(found) == [BAD_SEQUENCE] * (2 - 2 * uploaded)
            continue
        assert [(m.command, m.frame, m.z) for m in items] == [(WAYPOINT, 0, SITE.altitude)] * 2
        assert (items[0].x, items[0].y) == (round(SITE.latitude * 1e7), round(SITE.longitude * 1e7))
        if uploaded:
            assert len(download(client)) == len(SQUARE)


@pytest.mark.parametrize("make", [item, old_item])
def test_an_item_that_is_no_item_of_a_plan_flies_an_arducopter_in_guided(make):
    """``current`` is 2: how DroneKit's ``simple_goto`` flies."""
    for flavour in FLAVOURS:
        rig = Rig(flavour, start_height=5.0)
        client = Client(rig)
        client.wait(1.2)

        def goto(client: Client = client) -> list[int]:
            message = make(at(6, -4, 7), 0)
            message.current = 2
            return acks(client.send(message))

        if flavour == "px4":
            assert goto() == [DENIED]
            continue
        assert client.command(176, 1, 5) == 0
        assert goto() == [ERROR]
        assert client.command(176, 1, 4) == 0
        assert goto() == [ACCEPTED]
        client.wait(15.0)
        north, east, down = rig.autopilot.state.position
        assert (north, east, -down) == pytest.approx((6.0, -4.0, 7.0), abs=0.4)
        assert download(client) == []
