"""Whatever arrives by whatever link: nothing raises, nothing dangerous is sent, no NaN ever leaves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.values.phase import Phase
from mavlink_bridge.messages import BY_ID, CommandLong, SetpointLocal, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import frame_v1, frame_v2
from tests.companion.bench import AUTOPILOT, LINKS, TARGET, Bench, numbers_of, only, seen_at
from tests.companion.rig import QUICK

SHARED = settings(QUICK, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
"""One bench for all examples of a law that says that nothing changes."""
PLACE = np.array([0.0, 0.0, 5.0])
ROWS = st.sampled_from(tuple(BY_ID.values()))
BYTES = st.binary(max_size=300)


@st.composite
def frames(draw, systems):
    """Soundly framed messages of any kind with any payload, from systems that are not to be believed."""
    row = draw(ROWS)
    source = Source(draw(systems), draw(st.integers(0, 255)))
    payload = draw(st.binary(min_size=row.struct.size, max_size=row.struct.size))
    make = frame_v2 if row.id > 255 or draw(st.booleans()) else frame_v1
    size = row.struct.size if make is frame_v2 else row.size_v1
    return make(row.id, row.crc_extra, source, draw(st.integers(0, 255)), payload[:size])


STRANGERS = st.integers(0, 255).filter(lambda system: system not in (AUTOPILOT.system, TARGET))
JUNK = st.one_of(BYTES, frames(STRANGERS), frames(STRANGERS).map(lambda frame: frame[:-1]))
INBOX = st.lists(
    st.tuples(st.sampled_from(LINKS), st.lists(JUNK, min_size=1, max_size=4).map(b"".join)).map(
        lambda pair: Datagram(*pair)
    ),
    min_size=1,
    max_size=4,
)


@pytest.fixture(scope="module")
def connecting():
    bench = Bench()
    bench.fly(1.0)
    return bench


@pytest.fixture(scope="module")
def hovering():
    bench = Bench("px4").take_off(5.0)
    bench.fly(1.0)
    return bench


@pytest.fixture(scope="module")
def parked():
    return Bench().take_off(5.0)


@SHARED
@given(inbox=INBOX)
def test_on_the_ground_garbage_starts_nothing(connecting, inbox):
    sent = connecting.step(*inbox) + connecting.fly(0.1)
    assert {m.command for m in only(CommandLong, sent)} <= {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
    }
    assert only(SetpointLocal, sent) == []
    assert connecting.phase is Phase.CONNECT
    assert not connecting.autopilot.armed


@SHARED
@given(inbox=INBOX)
def test_in_the_air_garbage_orders_nothing_and_set_points_stay_finite(hovering, inbox):
    """Strangers on the swarm link may well be avoided; they are heard of for two seconds."""
    sent = hovering.step(*inbox) + hovering.fly(0.1)
    assert only(CommandLong, sent) == []
    found = only(SetpointLocal, sent)
    assert len(found) >= 5
    assert np.isfinite([numbers_of(m) for m in found]).all()
    assert hovering.phase is Phase.ESCORT
    # However many claim to be near, it does not leave faster than it may.
    limits = hovering.config.limits
    assert max(np.abs(m.velocity).max() for m in found) <= max(limits.v_max) + 0.1


@SHARED
@given(inbox=INBOX.map(lambda inbox: [d for d in inbox if d.link != "swarm"]))
def test_in_the_air_garbage_on_any_other_link_moves_nothing(parked, inbox):
    for message in only(SetpointLocal, parked.step(*inbox) + parked.fly(0.1)):
        north, east, down = message.position
        np.testing.assert_allclose([east, north, -down], PLACE, atol=0.1)


@QUICK
@given(payloads=st.lists(frames(st.just(AUTOPILOT.system)), min_size=1, max_size=6))
def test_whatever_the_own_autopilot_says_no_set_point_is_anything_but_finite(payloads):
    bench = Bench().take_off(5.0)
    sent = []
    for payload in payloads:
        sent += bench.step(Datagram("autopilot", payload))
    sent += bench.fly(0.3)
    for message in only(SetpointLocal, sent):
        assert np.isfinite(numbers_of(message)).all()


@QUICK
@given(payloads=st.lists(frames(st.just(TARGET)), min_size=1, max_size=6))
def test_whatever_the_target_says_no_set_point_is_anything_but_finite(payloads):
    bench = Bench(task="escort", target_d_min=1.0, target_d_safe=3.0)
    bench.target = seen_at(TARGET, [4.0, 0.0, 0.0])
    bench.take_off(5.0)
    sent = []
    for payload in payloads:
        sent += bench.step(Datagram("target", payload))
    sent += bench.fly(0.3)
    found = only(SetpointLocal, sent)
    assert np.isfinite([numbers_of(m) for m in found]).all()
    assert max(np.abs(m.velocity).max() for m in found) <= max(bench.config.limits.v_max) + 0.1


def test_a_frame_that_somebody_cut_off_holds_up_nobody_else():
    """Links deliver whole frames (streams are put together by who reads them), but several speak on one."""
    alone, among = Bench(), Bench()
    order = alone.datagram("ground", CommandLong(Source(255, 190), 11, 195, 22, 0, (0, 0, 0, 0, 0, 0, 5.0)))
    alone.step()
    alone.step(order)
    among.step(Datagram("ground", b"\xfd\xff" + order.data[2:9]))
    among.step(order)
    assert alone.sent == among.sent


def test_bad_frames_are_counted():
    bench = Bench()
    good = Codec().encode(seen_at(TARGET, [0.0, 0.0, 0.0]))
    bench.step(Datagram("target", good[:-1] + bytes([good[-1] ^ 1])), Datagram("target", good))
    assert bench.companion.bad_frames == 1
    assert bench.companion.world.at(bench.now).target is not None


@st.composite
def seeming(draw, kinds):
    """A frame of one of ``kinds`` whose fields are as likely at their ends as anywhere."""
    row = draw(st.sampled_from([row for row in BY_ID.values() if row.id in kinds]))
    size = row.struct.size
    byte = st.sampled_from((0, 1, 2, 7, 12, 0x7F, 0x80, 0xFF)) | st.integers(0, 255)
    payload = bytes(draw(st.lists(byte, min_size=24, max_size=24)) * (size // 24 + 1))[:size]
    source = Source(draw(st.sampled_from((AUTOPILOT.system, TARGET, 12))), draw(st.sampled_from((1, 100))))
    return frame_v2(row.id, row.crc_extra, source, draw(st.integers(0, 255)), payload)


SENSED = st.tuples(
    st.sampled_from(("autopilot", "swarm", "target")),
    seeming(
        {
            mavlink.MAVLINK_MSG_ID_FOLLOW_TARGET,
            mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE,
            mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
            mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE,
        }
    ),
)


@pytest.mark.parametrize("kind", ["follow_target", "camera"])
@QUICK
@given(told=st.lists(SENSED, min_size=1, max_size=12))
def test_whatever_sensors_receivers_and_cameras_say_no_set_point_leaves_the_limits(kind, told):
    bench = Bench(
        task="escort", target_source={"kind": kind}, proximity={}, traffic={}, ground_messages={"texts": True}
    ).take_off(5.0)
    sent = []
    for link, frame in told:
        sent += bench.step(Datagram(link, frame))
    sent += bench.fly(0.3)
    found = only(SetpointLocal, sent)
    assert np.isfinite([numbers_of(m) for m in found]).all()
    assert max(np.abs(m.velocity).max() for m in found) <= max(bench.config.limits.v_max) + 0.1
    assert bench.phase is Phase.ESCORT
