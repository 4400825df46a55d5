"""Laws of the codec on streams: whatever the bytes around it, all is read and accounted for."""

from __future__ import annotations

from hypothesis import assume, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mavlink_bridge import messages as m
from mavlink_bridge.messages import BY_ID, BY_TYPE
from mavlink_bridge.wire.codec import Codec
from tests.mavlink_bridge.damage import damaged
from tests.mavlink_bridge.message_values import (
    BEAT,
    POSITION,
    UNKNOWN_TO_PEER,
    any_message,
    known_message,
    wire,
)


def test_each_source_counts_its_own_sequence_modulo_256() -> None:
    codec, other = Codec(), m.Source(12, 1)
    mine = [codec.encode(BEAT)[4] for _ in range(300)]
    assert mine == [number % 256 for number in range(300)]
    assert codec.encode(BEAT._replace(source=other))[4] == 0


@given(st.lists(any_message, max_size=8), st.lists(st.booleans(), min_size=8, max_size=8), st.data())
def test_chunks_make_no_difference_and_versions_mix(
    messages: list[m.Message], old: list[bool], data: st.DataObject
) -> None:
    codec = Codec()
    stream = b"".join(
        codec.encode_v1(message) if version_1 and BY_TYPE[type(message)].id < 256 else codec.encode(message)
        for message, version_1 in zip(messages, old, strict=False)
    )
    whole, pieces = Codec(), Codec()
    expected = whole.feed(stream)
    assert len(expected) == len(messages)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    found = [
        message
        for start, stop in zip([0, *cuts], [*cuts, len(stream)], strict=True)
        for message in pieces.feed(stream[start:stop])
    ]
    assert found == expected
    assert pieces.counters == whole.counters


TRAILER = b"".join(wire(POSITION) for _ in range(20))


@given(
    st.binary(max_size=400) | st.lists(any_message, max_size=5).map(lambda x: b"".join(map(wire, x))),
    st.data(),
)
def test_any_bytes_are_survived_and_accounted_for(stream: bytes, data: st.DataObject) -> None:
    """In: bytes of frames handed out, of frames passed over, of none, and of one not yet complete."""
    stream = damaged(stream, data, times=6, inserted=12, cut=20)
    codec = Codec()
    found = codec.feed(stream + TRAILER)
    good, bad, unknown, filtered, skipped, _ = codec.counters
    assert len(found) == good
    assert codec.pending_bytes <= 288
    assert skipped + codec.pending_bytes + 8 * (good + filtered + unknown) <= len(stream + TRAILER)
    # The longest frame has 288 bytes: garbage cannot hide more than that of what follows, unless an unknown
    # message was passed over by its length.
    if unknown == 0:
        assert found.count(POSITION) >= 20 - 288 // 40
    assert bad <= len(stream) + len(TRAILER)


@given(st.binary(max_size=300))
def test_garbage_does_not_swallow_the_frames_behind_it(garbage: bytes) -> None:
    codec = Codec()
    padding = bytes(288)
    found = codec.feed(garbage + wire(POSITION) + wire(BEAT) + padding)
    assume(codec.counters.unknown == 0)
    assert found[-2:] == [POSITION, BEAT]
    assert codec.counters.skipped_bytes + codec.pending_bytes >= len(padding) + len(garbage) * (
        len(found) == 2
    )


@given(st.lists(any_message, min_size=1, max_size=6), st.integers(0, 5), st.data())
def test_a_broken_frame_costs_only_itself(messages: list[m.Message], which: int, data: st.DataObject) -> None:
    frames = [wire(message) for message in messages]
    which %= len(frames)
    at = data.draw(st.integers(7, len(frames[which]) - 1))
    broken = bytearray(frames[which])
    broken[at] ^= data.draw(st.integers(1, 255))
    codec = Codec()
    found = codec.feed(b"".join([*frames[:which], bytes(broken), *frames[which + 1 :]]) + bytes(300))
    others = messages[:which] + messages[which + 1 :]
    # A broken message id may be one that the dialect lacks (passed over) or has (its checksum fails).
    assert found == others
    assert codec.counters.bad + codec.counters.unknown >= 1


def unknown_frame(length: int = 5) -> bytes:
    frame = bytearray(
        b"\xfd" + bytes((length, 0, 0, 9, 1, 1, 0xEF, 0xBE, 0xAD)) + bytes(length) + b"\x12\x34"
    )
    assert 0xADBEEF not in dialect.mavlink_map
    return bytes(frame)


def test_unknown_messages_are_passed_over_by_their_length() -> None:
    codec = Codec()
    hidden = bytearray(unknown_frame(len(wire(BEAT))))
    hidden[10:-2] = wire(BEAT)
    assert codec.feed(bytes(hidden) + wire(POSITION)) == [POSITION]
    assert codec.counters == (1, 0, 1, 0, 0, 0)


def test_a_false_start_that_looks_unknown_hides_nothing() -> None:
    codec = Codec()
    assert codec.feed(unknown_frame(60)[:10] + wire(POSITION) + wire(BEAT) + bytes(60)) == [POSITION, BEAT]
    assert codec.counters.unknown == 0


def test_frames_with_a_feature_that_is_not_understood_are_refused() -> None:
    frame = bytearray(wire(POSITION))
    frame[2] = 0x02
    codec = Codec()
    assert codec.feed(bytes(frame) + wire(BEAT)) == [BEAT]
    assert codec.counters.bad >= 1


@given(known_message)
def test_signed_frames_are_read(message: m.Message) -> None:
    peer = dialect.MAVLink(None, srcSystem=message.source.system, srcComponent=message.source.component)
    message = message._replace(**UNKNOWN_TO_PEER.get(type(message), {}))
    peer.signing.secret_key = bytes(range(32))
    peer.signing.sign_outgoing = True
    peer.signing.timestamp = 1
    signed_frame = dialect.MAVLink(None).decode(bytearray(wire(message))).pack(peer)
    codec = Codec()
    assert codec.feed(signed_frame + signed_frame) == [message, message]
    assert codec.counters == (2, 0, 0, 0, 0, 0)


# Filter


@given(st.lists(any_message, max_size=8), st.sets(st.sampled_from(sorted(BY_ID))))
def test_the_filter_sees_header_and_decides(messages: list[m.Message], wanted: set[int]) -> None:
    asked = []

    def accept(message_id: int, system: int, component: int) -> bool:
        asked.append((message_id, system, component))
        return message_id in wanted

    codec = Codec(accept)
    found = codec.feed(b"".join(map(wire, messages)))
    assert found == [message for message in messages if BY_TYPE[type(message)].id in wanted]
    assert asked == [(BY_TYPE[type(message)].id, *message.source) for message in messages]
    assert codec.counters == (len(found), 0, 0, len(messages) - len(found), 0, 0)


def test_the_filter_is_not_asked_about_what_fails_its_checksum() -> None:
    asked: list[int] = []
    codec = Codec(lambda message_id, system, component: bool(asked.append(message_id)))
    frame = bytearray(wire(POSITION))
    frame[20] ^= 1
    assert codec.feed(bytes(frame)) == []
    assert asked == []
    assert codec.counters.filtered == 0


def test_sound_messages_that_are_in_no_table_count_as_filtered() -> None:
    frame = dialect.MAVLink_vibration_message(1, 2, 3, 4, 5, 6, 7).pack(dialect.MAVLink(None))
    codec = Codec()
    assert codec.feed(frame) == []
    assert codec.counters == (0, 0, 0, 1, 0, 0)
