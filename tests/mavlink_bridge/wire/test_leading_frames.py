"""Laws of reading a datagram that was read before: what is remembered is what would be found anew."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge import messages as m
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Frame, Framer, frame_at, leading_frames

SOURCE = m.Source(11, 191)
BEATS = [Codec().encode(m.Heartbeat(SOURCE, 2, 3, 81, number, 4)) for number in range(4)]
FRAMES = st.sampled_from([*BEATS, Codec().encode_v1(m.Ping(SOURCE, 5, 1, 0, 0))])
UNKNOWN = b"\xfd\x01\x00\x00\x09\x01\x01\xef\xbe\xad\x07\x12\x34"
streams = st.lists(FRAMES | st.binary(max_size=30) | st.just(UNKNOWN) | st.just(bytes(3000)), max_size=6)


@given(streams.map(b"".join), st.booleans())
def test_they_are_the_frames_one_behind_the_other(data: bytes, changeable: bool) -> None:
    """However long the data, and whether it can be remembered or not."""
    for _ in range(2):
        frames, at = leading_frames(bytearray(data) if changeable else data)
        assert b"".join(frame.data for frame in frames) == data[:at]
        start = 0
        for frame in frames:
            assert frame == frame_at(data, start)
            start += len(frame.data)
        following = frame_at(data, at)
        assert not (isinstance(following, Frame) and following.known)


@given(streams)
def test_who_reads_first_leaves_the_same_to_the_next(pieces: list[bytes]) -> None:
    """Counters, messages and what is pending: fed whole for the first and the second time, and piece by
    piece."""
    readers = [Codec() for _ in range(3)]
    found = [reader.feed(b"".join(pieces)) for reader in readers[:2]]
    found.append([message for piece in pieces for message in readers[2].feed(piece)])
    assert found[0] == found[1] == found[2]
    assert readers[0].counters == readers[1].counters == readers[2].counters
    assert readers[0].pending_bytes == readers[1].pending_bytes == readers[2].pending_bytes


def test_bytes_that_change_are_read_anew() -> None:
    data = bytearray(BEATS[0])
    (frame,) = Framer().feed(data)
    assert frame.data == BEATS[0]
    data[:] = BEATS[1]
    (frame,) = Framer().feed(data)
    assert frame.data == BEATS[1]
    data[12] ^= 1
    framer = Framer()
    assert list(framer.feed(data)) == []
    assert framer.bad == 1
