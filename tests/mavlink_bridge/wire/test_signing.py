"""Signed messages: who counts, once; and pymavlink on the other side."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge import messages as m
from mavlink_bridge.key import Key
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import without_signature
from mavlink_bridge.wire.signing import LATEST, LEAD, MINUTE, RADIOS, STREAMS, Refusal, Signing
from tests.mavlink_bridge.message_values import UNKNOWN_TO_PEER, any_message, known_message
from tests.mavlink_bridge.signers import KEY, ME, NOW, SECOND, beat, frame_of, peer, signed, signing, stamp_at

OTHER = Key.of_passphrase("battery staple")
STAMP = stamp_at(NOW)
stamps = st.integers(0, LATEST)


# With one key on both sides


@given(any_message, st.integers(0, 255))
def test_what_is_signed_is_read_again_and_only_that_is_longer(message: m.Message, link: int) -> None:
    writer, reader = Codec(None, signing(), link), Codec(None, signing())
    data = writer.encode(message)
    assert reader.feed(data) == [message]
    assert reader.counters == (1, 0, 0, 0, 0, 0)
    assert data[-13] == link
    assert without_signature(data) == Codec().encode(message)
    assert len(data) == len(without_signature(data)) + dialect.MAVLINK_SIGNATURE_BLOCK_LEN


@given(known_message, st.integers(0, 255))
def test_pymavlink_reads_what_we_sign_and_the_reverse(message: m.Message, link: int) -> None:
    ours = Codec(None, signing(), link)
    theirs = peer(source=message.source, link=link)
    seen = theirs.decode(bytearray(ours.encode(message)))
    assert seen.get_signed()
    assert theirs.signing.goodsig_count == 1
    known = message._replace(**UNKNOWN_TO_PEER.get(type(message), {}))
    reader = Codec(None, signing())
    assert reader.feed(seen.pack(theirs)) == [known]


def test_a_long_text_is_several_signed_frames() -> None:
    text = m.StatusText(ME, 6, "long " * 30)
    theirs = peer()
    found = theirs.parse_buffer(bytearray(Codec(None, signing()).encode(text)))
    assert len(found) > 2
    assert theirs.signing.goodsig_count == len(found)


@given(st.lists(st.integers(0, 50), min_size=1, max_size=30))
def test_each_stamp_is_later_than_the_one_before_and_than_the_clock(pauses: list[int]) -> None:
    signer, reader = signing(), signing()
    codec, now, before = Codec(None, signer), NOW, 0
    for pause in pauses:
        now += pause
        signer.present(now)
        data = codec.encode(beat())
        stamp = int.from_bytes(data[-12:-6], "little")
        assert stamp > max(before, stamp_at(now))
        assert reader.check(frame_of(data)) is None
        before = stamp
    assert reader.newest == before


@given(st.permutations(range(6)))
def test_of_a_stream_nothing_counts_that_comes_late_or_again(order: list[int]) -> None:
    """Whatever the order of arrival: what counts is each that is newer than all before it."""
    reader = Codec(None, signing())
    frames = [signed(STAMP + 1 + k, k) for k in range(6)]
    found = [message.sequence for k in order for message in reader.feed(frames[k] + frames[k])]
    assert found == [k for at, k in enumerate(order) if all(k > before for before in order[:at])]
    assert reader.counters.refused == 12 - len(found)


def test_streams_are_of_a_system_a_component_and_a_link() -> None:
    reader = Codec(None, signing())
    for source, link in ((ME, 0), (m.Source(254, 190), 0), (m.Source(255, 191), 0), (ME, 1)):
        assert len(reader.feed(signed(STAMP + 5, source=source, link=link))) == 1
        assert reader.feed(signed(STAMP + 5, source=source, link=link)) == []


def test_links_of_one_node_share_what_was_heard() -> None:
    mine = signing()
    one, other = Codec(None, mine, 0), Codec(None, mine, 1)
    data = signed(STAMP + 1)
    assert len(one.feed(data)) == 1
    assert other.feed(data) == []


# With another key, or none


@given(any_message, st.data())
def test_a_signed_frame_that_was_touched_anywhere_does_not_count(
    message: m.Message, data: st.DataObject
) -> None:
    frame = bytearray(Codec(None, signing()).encode(message))
    at = data.draw(st.integers(0, len(frame) - 1))
    frame[at] ^= data.draw(st.integers(1, 255))
    assert Codec(None, signing()).feed(bytes(frame), whole=True) == []


@given(st.sampled_from([*RADIOS, 0, 4, 76]), st.binary(min_size=6, max_size=6), stamps)
def test_a_wrong_signature_never_counts_not_even_where_none_would_do(
    message_id: int, signature: bytes, stamp: int
) -> None:
    plain = dialect.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
    kind = {166: dialect.MAVLink_radio_message, 109: dialect.MAVLink_radio_status_message}.get(message_id)
    frame = (kind(1, 2, 3, 4, 5, 6, 7) if kind else plain).pack(peer())
    forged = frame[:-12] + stamp.to_bytes(6, "little") + signature
    mine = signing(unsigned=[*RADIOS, message_id])
    if forged != frame:
        assert mine.check(frame_of(forged)) in (Refusal.FORGED, Refusal.OLD)
    assert mine.check(frame_of(without_signature(frame))) is None


@given(stamps, st.binary(min_size=6, max_size=6))
def test_a_forged_stamp_locks_nobody_out(stamp: int, signature: bytes) -> None:
    """pymavlink 2.4.50 remembers the stamp before it looks at the signature."""
    mine = signing()
    reader = Codec(None, mine)
    good = signed(STAMP + 1)
    forged = good[:-12] + stamp.to_bytes(6, "little") + signature
    if forged != good:
        assert reader.feed(forged) == []
    assert mine.newest == STAMP
    assert len(reader.feed(good)) == 1


def test_without_a_signature_only_the_listed_count_and_without_a_key_all() -> None:
    plain, old = Codec().encode(beat()), Codec().encode_v1(beat())
    radio = dialect.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7).pack(dialect.MAVLink(None))
    mine = signing()
    assert mine.check(frame_of(plain)) is mine.check(frame_of(old)) is Refusal.UNSIGNED
    assert mine.check(frame_of(radio)) is None
    assert signing(unsigned=()).check(frame_of(radio)) is Refusal.UNSIGNED
    keyless = Codec(None, signing(key=None))
    assert len(keyless.feed(plain + old + signed(STAMP))) == 3
    assert keyless.encode(beat()) == plain


def test_what_is_refused_is_counted_by_its_reason() -> None:
    mine = signing()
    reader = Codec(None, mine)
    good = signed(STAMP + 1)
    reader.feed(good + good + signed(STAMP + 9, key=OTHER) + Codec().encode(beat()))
    assert mine.refused == {Refusal.OLD: 1, Refusal.FORGED: 1, Refusal.UNSIGNED: 1, Refusal.AHEAD: 0}
    assert mine.latest is Refusal.UNSIGNED
    assert reader.counters == (1, 0, 0, 0, 0, 3)


def test_what_nobody_wants_is_not_looked_at() -> None:
    mine = signing()
    reader = Codec(lambda *_: False, mine)
    assert reader.feed(signed(STAMP + 1) + Codec().encode(beat())) == []
    assert reader.counters == (0, 0, 0, 2, 0, 0)
    assert mine.newest == STAMP


# Time


@pytest.mark.parametrize(("behind", "counts"), [(0, True), (MINUTE, True), (MINUTE + 1, False)])
def test_a_new_stream_may_be_a_minute_behind(behind: int, counts: bool) -> None:
    mine = signing(NOW - 3_600_000_000)
    mine.present(NOW)
    assert (mine.check(frame_of(signed(STAMP - behind))) is None) == counts


def test_a_known_stream_goes_on_however_far_it_is_behind() -> None:
    """Many clients count on from when they began, and hear nothing of ours."""
    mine = signing()
    assert mine.check(frame_of(signed(STAMP + 1))) is None
    mine.present(NOW + 3_600_000_000)
    assert mine.check(frame_of(signed(STAMP + 2))) is None


def test_what_was_recorded_before_the_start_does_not_count_after_it() -> None:
    """With a clock; and without one by what was kept."""
    captured = frame_of(signed(STAMP - SECOND))
    assert signing().check(captured) is Refusal.OLD
    clockless = Signing(KEY)
    clockless.resume(STAMP)
    clockless.present(123)
    assert clockless.check(captured) is Refusal.OLD
    assert clockless.check(frame_of(signed(STAMP + 1))) is None
    assert clockless.newest == STAMP + 1


def test_who_knows_no_time_takes_the_others() -> None:
    mine = Signing(KEY)
    mine.present(0)
    assert Codec(None, mine).encode(beat())[-12:-6] == (1).to_bytes(6, "little")
    assert mine.check(frame_of(signed(STAMP))) is None
    assert mine.newest == STAMP
    theirs = peer()
    assert theirs.decode(bytearray(Codec(None, mine).encode(beat()))).get_signed()


@given(stamps)
def test_at_the_end_of_time_nothing_breaks(stamp: int) -> None:
    mine = signing()
    mine.resume(stamp)
    codec = Codec(None, mine)
    for _ in range(2):
        assert codec.encode(beat())
    mine.use(OTHER, 2**64 - 1)
    assert codec.encode(beat())
    mine.present(2**62)
    assert codec.encode(beat())


def test_a_holder_of_the_key_at_the_end_of_time_locks_nobody_out() -> None:
    mine = signing()
    assert mine.check(frame_of(signed(LATEST))) is Refusal.AHEAD
    assert mine.check(frame_of(signed(STAMP + LEAD + 1))) is Refusal.AHEAD
    newcomer = m.Source(77, 1)
    assert mine.check(frame_of(signed(STAMP + 1, source=newcomer))) is None
    # Nor the sender whose ids it used, nor is what is sent from here stamped so.
    assert mine.check(frame_of(signed(STAMP + 2))) is None
    assert mine.newest == STAMP + 2
    assert mine.check(frame_of(signed(STAMP + LEAD))) is None


@given(stamps)
def test_a_stamp_counts_as_far_ahead_as_the_own_clock_allows(stamp: int) -> None:
    clockless, mine = Signing(KEY), signing()
    clockless.present(0)
    frame = frame_of(signed(stamp))
    assert (mine.check(frame) is Refusal.AHEAD) == (stamp > STAMP + LEAD)
    assert clockless.check(frame) is not Refusal.AHEAD


# Memory


def test_streams_are_bounded_and_what_is_forgotten_cannot_be_said_again() -> None:
    mine = signing()
    count = 2 * STREAMS
    sources = [m.Source(1 + k % 255, k // 255) for k in range(count)]
    frames = [frame_of(signed(STAMP + 1 + k, source=source)) for k, source in enumerate(sources)]
    assert all(mine.check(frame) is None for frame in frames)
    assert len(mine._streams) == STREAMS
    assert all(mine.check(frame) is Refusal.OLD for frame in frames)
    assert mine.check(frame_of(signed(STAMP + 1 + count, source=sources[0]))) is None


@given(st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255), st.integers(0, 255)), max_size=40))
def test_who_has_no_key_makes_no_stream(sources: list[tuple[int, int, int]]) -> None:
    mine = signing()
    for system, component, link in sources:
        mine.check(frame_of(signed(STAMP + 5, key=OTHER, source=m.Source(system, component), link=link)))
    assert mine._streams == {}


# Another key


def test_another_key_counts_instead_and_says_what_time_it_is() -> None:
    mine = signing()
    assert mine.check(frame_of(signed(STAMP + 10))) is None
    since = STAMP + 2 * MINUTE
    mine.use(OTHER, since)
    assert mine.check(frame_of(signed(since + 1))) is Refusal.FORGED
    assert mine.check(frame_of(signed(STAMP + 20, key=OTHER))) is Refusal.OLD
    assert mine.check(frame_of(signed(since - MINUTE, key=OTHER))) is None
    mine.use(None)
    assert mine.check(frame_of(Codec().encode(beat()))) is None


def test_the_same_key_once_more_makes_nothing_count_again() -> None:
    mine = signing()
    frame = frame_of(signed(STAMP + 10))
    assert mine.check(frame) is None
    mine.use(KEY, 0)
    assert mine.check(frame) is Refusal.OLD


def test_nothing_is_signed_without_a_key() -> None:
    with pytest.raises(ValueError, match="no key"):
        Signing().sign(b"", 0)


def test_a_clock_that_was_not_set_locks_out_nobody_after_a_restart() -> None:
    """The stored stamp proves that it is later than the clock says."""
    mine = Signing(KEY)
    mine.resume(STAMP)
    mine.present(NOW - 2 * 10 * LEAD)
    assert mine.check(frame_of(signed(STAMP + LEAD))) is None
    assert mine.check(frame_of(signed(STAMP + LEAD + 1))) is Refusal.AHEAD
