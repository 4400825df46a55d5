"""Frames with incompatibility flags that nobody knew when this was written are skipped whole: nothing that
their payload holds is received."""

from __future__ import annotations

import pytest
from fastcrc.crc16 import mcrf4xx
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.links.demultiplexer import Demultiplexer
from mavlink_bridge.links.link import memory_pair
from mavlink_bridge.messages import Heartbeat, Source
from mavlink_bridge.tlog.log import TlogReader, TlogWriter, read_tlog
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Framer

BEAT = Heartbeat(Source(7, 1), 2, 3, 0, 5, 4)
INNER = Codec().encode(Heartbeat(Source(9, 1), 2, 3, 128, 4, 4))
OUTER = Codec().encode(BEAT)
STATUSTEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT
SHORTENED = b"\xfd\x09\x80" + OUTER[3:]
"""It claims flags that nobody knows, and its checksum is of the frame without them."""
STRANGE = st.integers(2, 255)


def future(flags: int, payload: bytes, message_id: int = STATUSTEXT, extra: int | None = None) -> bytes:
    """A frame with the header that these flags mean, as by pymavlink's pull request 1229."""
    system = (0x0102A8C0).to_bytes(4, "little") if flags & 2 else b"\x07"
    target = b"\x01\x00\x00\x00\x01" if flags & 4 else b""
    body = bytes((len(payload), flags, 0, 5)) + system + b"\x01" + message_id.to_bytes(3, "little") + target
    body += payload
    known = mavlink.mavlink_map.get(message_id)
    seed = (0 if known is None else known.crc_extra) if extra is None else extra
    signature = bytes(13) if flags & 1 else b""
    return b"\xfd" + body + mcrf4xx(body + bytes((seed,))).to_bytes(2, "little") + signature


FRAMES = st.builds(
    future,
    STRANGE,
    st.one_of(st.just(INNER), st.binary(max_size=100).map(lambda more: INNER + more)),
    st.sampled_from([STATUSTEXT, 0, 33, 0xFFFFF0]),
    st.sampled_from([None, 17]),
)


@given(frames=st.lists(FRAMES, min_size=1, max_size=4), cuts=st.lists(st.integers(1, 40), max_size=30))
def test_nothing_inside_is_received_and_all_around_is(frames, cuts):
    data = b"".join(OUTER + frame for frame in frames) + OUTER
    codec, found, at = Codec(), [], 0
    for cut in [*cuts, len(data)]:
        found += codec.feed(data[at : at + cut])
        at += cut
    assert found == [BEAT] * (len(frames) + 1)
    assert codec.counters.bad == codec.counters.skipped_bytes == 0
    assert codec.counters.unknown == len(frames)


@given(
    parts=st.lists(st.one_of(FRAMES, st.just(OUTER), st.just(SHORTENED), st.binary(max_size=20)), max_size=5)
)
def test_a_log_skips_what_a_link_skips(parts, tmp_path_factory):
    data = b"".join(parts)
    framer = Framer(unknown=True)
    received = [frame.data for frame in framer.feed(data, whole=True)]
    path = tmp_path_factory.getbasetemp() / "one.tlog"
    with TlogWriter(path) as log:
        log.write(1_000_000, 0, data)
    logged = path.read_bytes()
    stamp = (1_000_000).to_bytes(8, "big")
    assert logged == b"".join(stamp + frame for frame in received)


@given(frame=FRAMES)
def test_a_datagram_of_one_is_empty(frame):
    codec = Codec()
    assert codec.feed(frame, whole=True) == []
    assert codec.feed(OUTER, whole=True) == [BEAT]
    assert codec.counters.bad == 0


@given(frame=FRAMES, garbage=st.binary(max_size=30).map(lambda data: b"." + data))
def test_what_is_no_frame_hides_no_more_than_its_length(frame, garbage):
    """An intact checksum is believed; a broken frame before garbage is a false start."""
    codec = Codec()
    codec.feed(frame + garbage + OUTER * 40)
    assert codec.counters.good >= 30


@pytest.mark.parametrize("flags", [2, 3, 4, 6, 8, 128])
def test_a_shared_link_and_a_log_skip_it_too(flags, tmp_path):
    own, far = memory_pair()
    end = Demultiplexer(own, {"swarm": lambda _header: True}).ends["swarm"]
    far.send(OUTER + future(flags, INNER))
    assert end.receive() == [OUTER]
    path = tmp_path / "flight.tlog"
    with TlogWriter(path) as log:
        log.write(1_000_000, 0, OUTER + future(flags, INNER) + OUTER)
        assert (log.records, log.skipped_bytes) == (2, len(future(flags, INNER)))
    stamp = (2_000_000).to_bytes(8, "big")
    path.write_bytes(stamp + OUTER + stamp + future(flags, INNER) + stamp + OUTER)
    log = read_tlog(path)
    assert [record.frame for record in log] == [OUTER, OUTER]
    assert isinstance(log, TlogReader)
    assert (log.report.good, log.report.bad, log.report.unknown) == (2, 0, 1)
