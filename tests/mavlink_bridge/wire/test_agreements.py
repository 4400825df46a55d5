"""Laws of statements on the wire: exact there and back; other bytes are refused; splitting loses nothing."""

from __future__ import annotations

from itertools import chain, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.agreements import (
    LARGEST,
    MOST_AGREEMENTS,
    PAYLOAD_TYPE,
    Entry,
    Epochs,
    Statement,
    in_messages,
    pack,
    unpack,
)
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN

HEADER = 20
times = st.integers(0, 2**56 - 1)
pairs: st.SearchStrategy[Epochs] = st.tuples(times, times)


@st.composite
def entries(draw: st.DrawFn) -> Entry:
    """Any entry; often its newest agreement is the considered one, as it is in flight."""
    agreements = tuple(draw(st.lists(pairs, max_size=MOST_AGREEMENTS)))
    considered = st.just(agreements[-1]) | pairs if agreements else pairs
    return Entry(draw(st.integers(1, 255)), agreements, draw(considered), draw(st.booleans()))


def statements(most: int) -> st.SearchStrategy[Statement]:
    some = st.lists(entries(), max_size=most).map(tuple)
    outside = st.integers(0, 63).map(lambda units: units * 0.05)
    both = st.booleans()
    return st.builds(Statement, st.integers(0, 2**32 - 1), times, times, some, both, both, outside)


@pytest.mark.parametrize(
    ("outside", "read"), [(1e-9, 0.0), (0.001, 0.05), (0.06, 0.1), (3.15, 3.15), (1e300, 3.15)]
)
def test_a_distance_outside_the_tube_is_rounded_up_as_far_as_it_fits(outside: float, read: float) -> None:
    statement = Statement(7, 5, 5, outside=outside)
    assert unpack(pack(statement)).outside == pytest.approx(read)


@pytest.mark.parametrize("outside", [-0.1, float("nan")])
def test_what_is_no_distance_is_not_sent(outside: float) -> None:
    with pytest.raises(PlanWireError):
        pack(Statement(7, 5, 5, outside=outside))


def size(entry: Entry) -> int:
    """Bytes of ``entry`` by the description of the format."""
    once = entry.agreements == (entry.considered,)
    return 2 + 14 * (len(entry.agreements) + (not once))


@given(statements(1))
def test_round_trip_is_exact(statement: Statement) -> None:
    data = pack(statement)
    assert len(data) == HEADER + sum(map(size, statement.entries)) <= LARGEST
    assert unpack(data) == statement
    assert pack(unpack(data)) == data


@given(statements(12))
def test_in_several_messages_every_entry_is_stated_once_and_in_its_order(statement: Statement) -> None:
    parts = in_messages(statement)
    assert tuple(chain.from_iterable(part.entries for part in parts)) == statement.entries
    for part in parts:
        assert part._replace(entries=()) == statement._replace(entries=())
        assert len(pack(part)) <= LARGEST
        assert unpack(pack(part)) == part
    for part, after in pairwise(parts):
        # No message is sent that the one before has room for.
        assert len(pack(part)) + size(after.entries[0]) > LARGEST


@given(entries(), st.integers(0, 8))
def test_a_message_takes_exactly_as_many_entries_as_its_bytes_have_room_for(entry: Entry, many: int) -> None:
    """So the length by which entries are divided is that of their bytes, for any entry."""
    alone = len(pack(Statement(0, 0, 0, (entry,)))) - HEADER
    room = (LARGEST - HEADER) // alone
    parts = in_messages(Statement(0, 0, 0, (entry,) * many))
    full, rest = divmod(many, room)
    assert [len(part.entries) for part in parts if part.entries] == [room] * full + [rest] * (rest > 0)
    # Entries of 16 bytes beside it fill what is left, and one more does not fit.
    small = Entry(1)
    beside = (LARGEST - HEADER - alone) // 16
    assert len(in_messages(Statement(0, 0, 0, (entry, *(small,) * beside)))) == 1
    assert len(in_messages(Statement(0, 0, 0, (entry, *(small,) * (beside + 1))))) == 2


def test_seven_peers_with_an_agreement_each_need_one_message() -> None:
    of = [Entry(peer, ((2**50, 2**50),), (2**50, 2**50)) for peer in range(1, 7)]
    assert len(in_messages(Statement(7, 2**50, 2**49, tuple(of)))) == 1


def test_too_many_entries_for_one_message_are_not_packed() -> None:
    of = [Entry(peer, ((1, 2), (3, 4)), (3, 4)) for peer in range(1, 4)]
    with pytest.raises(PlanWireError, match="3 entries"):
        pack(Statement(0, 0, 0, tuple(of)))


@given(
    st.binary(max_size=140)
    | st.binary(min_size=HEADER - 2, max_size=HEADER + 16).map(lambda rest: b"\x01\x00" + rest)
    | st.tuples(st.binary(min_size=18, max_size=18), entries(), st.binary(max_size=20)).map(
        lambda parts: b"\x01\x01" + parts[0] + pack(Statement(0, 0, 0, (parts[1],)))[HEADER:] + parts[2]
    )
)
def test_other_bytes_are_refused_or_are_a_statement(data: bytes) -> None:
    try:
        statement = unpack(data)
    except PlanWireError:
        return
    assert pack(statement) == data


@given(statements(1), st.data())
def test_one_bit_makes_it_another_statement_or_none(statement: Statement, data: st.DataObject) -> None:
    packed = bytearray(pack(statement))
    bit = data.draw(st.integers(0, 8 * len(packed) - 1))
    packed[bit // 8] ^= 1 << bit % 8
    try:
        other = unpack(bytes(packed))
    except PlanWireError:
        return
    assert other != statement
    assert pack(other) == bytes(packed)


@given(statements(1), st.data())
def test_what_is_cut_off_within_an_entry_is_refused(statement: Statement, data: st.DataObject) -> None:
    packed = pack(statement)
    length = data.draw(st.integers(0, len(packed) - 1))
    if length == HEADER:
        assert unpack(packed[:length]).entries == ()
        return
    with pytest.raises(PlanWireError):
        unpack(packed[:length])


@pytest.mark.parametrize(
    "bad",
    [
        Statement(-1, 0, 0),
        Statement(2**32, 0, 0),
        Statement(0, -1, 0),
        Statement(0, 2**56, 0),
        Statement(0, 0, -1),
        Statement(0, 0, 2**56),
        Statement(0, 0, 0, (Entry(0),)),
        Statement(0, 0, 0, (Entry(256),)),
        Statement(0, 0, 0, (Entry(1, ((0, -1),)),)),
        Statement(0, 0, 0, (Entry(1, (), (2**56, 0)),)),
        Statement(0, 0, 0, (Entry(1, ((1, 1),) * (MOST_AGREEMENTS + 1)),)),
    ],
    ids=str,
)
def test_what_does_not_fit_is_refused(bad: Statement) -> None:
    with pytest.raises(PlanWireError):
        pack(bad)


def test_the_payload_type_is_for_private_use_and_not_that_of_plans() -> None:
    assert 32767 < PAYLOAD_TYPE <= 65535
    assert PAYLOAD_TYPE != PLAN


def test_bytes_are_as_documented() -> None:
    agreement, older = (0x11, 0x22), (0x33, 0x44)
    pair, before = "11000000000000" + "22000000000000", "33000000000000" + "44000000000000"
    for entry, expected in (
        (Entry(9, (agreement,), agreement), "09" + "41" + pair),
        (Entry(9, (older,), agreement, departed=True), "09" + "81" + pair + before),
        (Entry(255, (older, agreement), agreement), "ff" + "02" + pair + before + pair),
        (Entry(255), "ff" + "00" + "00" * 14),
    ):
        data = pack(Statement(0x01020304, 0x01020304050607, 0x0A, (entry,), farewell=True))
        assert data.hex() == "0101" + "04030201" + "07060504030201" + "0a000000000000" + expected
