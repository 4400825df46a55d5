"""Laws of the roster on the wire: exact there and back; other bytes are refused or are another roster."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.roster import PAYLOAD_TYPE, Roster, pack, unpack

rosters = st.builds(Roster, st.integers(0, 2**56 - 1), st.frozensets(st.integers(1, 255)), st.booleans())


@given(rosters)
def test_round_trip_is_exact(roster: Roster) -> None:
    data = pack(roster)
    assert len(data) == 41
    assert unpack(data) == roster
    assert pack(unpack(data)) == data


@given(st.binary(max_size=50) | st.binary(min_size=39, max_size=39).map(lambda rest: b"\x01\x00" + rest))
def test_other_bytes_are_refused_or_are_a_roster(data: bytes) -> None:
    try:
        roster = unpack(data)
    except PlanWireError:
        return
    assert pack(roster) == data


@given(rosters, st.integers(0, 8 * 41 - 1))
def test_one_bit_makes_it_another_roster_or_none(roster: Roster, bit: int) -> None:
    data = bytearray(pack(roster))
    data[bit // 8] ^= 1 << bit % 8
    try:
        other = unpack(bytes(data))
    except PlanWireError:
        return
    assert other != roster
    assert pack(other) == bytes(data)


@pytest.mark.parametrize(
    "bad",
    [
        Roster(0, frozenset({0})),
        Roster(0, frozenset({256})),
        Roster(0, frozenset({-1})),
        Roster(-1, frozenset()),
        Roster(2**56, frozenset()),
    ],
    ids=str,
)
def test_what_does_not_fit_is_refused(bad: Roster) -> None:
    with pytest.raises(PlanWireError):
        pack(bad)


def test_the_payload_type_is_for_private_use_and_not_that_of_plans() -> None:
    assert 32767 < PAYLOAD_TYPE <= 65535
    assert PAYLOAD_TYPE != PLAN


def test_bytes_are_as_documented() -> None:
    data = pack(Roster(0x01020304050607, frozenset({1, 8, 255}), farewell=True))
    assert data.hex() == "0101" + "07060504030201" + "0201" + 29 * "00" + "80"
