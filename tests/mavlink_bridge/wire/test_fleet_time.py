"""Laws of fleet time on the wire: exact there and back; other bytes are refused or are another fleet time."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.fleet_time import PAYLOAD_TYPE, Estimate, FleetTime, pack, unpack
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.uncertainty import PAYLOAD_TYPE as UNCERTAINTY

offsets = st.integers(-(2**63), 2**63 - 1)
estimates = st.builds(Estimate, offsets, st.integers(0, 2**32 - 1))
messages = st.builds(FleetTime, st.integers(0, 2**56 - 1), st.none() | offsets, st.none() | estimates)


@given(messages)
def test_round_trip_is_exact(message: FleetTime) -> None:
    data = pack(message)
    assert len(data) == 29
    assert unpack(data) == message
    assert pack(unpack(data)) == data


@given(
    st.binary(max_size=40)
    | st.tuples(st.integers(0, 3), st.binary(min_size=27, max_size=27)).map(
        lambda parts: bytes((1, parts[0])) + parts[1]
    )
)
def test_other_bytes_are_refused_or_are_a_fleet_time(data: bytes) -> None:
    try:
        message = unpack(data)
    except PlanWireError:
        return
    assert pack(message) == data


@given(messages, st.integers(0, 8 * 29 - 1))
def test_one_bit_makes_it_another_or_none(message: FleetTime, bit: int) -> None:
    data = bytearray(pack(message))
    data[bit // 8] ^= 1 << bit % 8
    try:
        other = unpack(bytes(data))
    except PlanWireError:
        return
    assert other != message
    assert pack(other) == bytes(data)


@pytest.mark.parametrize(
    "bad",
    [
        FleetTime(-1, None, None),
        FleetTime(2**56, None, None),
        FleetTime(0, 2**63, None),
        FleetTime(0, -(2**63) - 1, None),
        FleetTime(0, None, Estimate(2**63, 0)),
        FleetTime(0, None, Estimate(0, 2**32)),
        FleetTime(0, None, Estimate(0, -1)),
    ],
    ids=str,
)
def test_what_does_not_fit_is_refused(bad: FleetTime) -> None:
    with pytest.raises(PlanWireError):
        pack(bad)


@pytest.mark.parametrize("position", [9, 17, 25])
def test_a_value_that_is_called_unknown_is_refused(position: int) -> None:
    data = bytearray(pack(FleetTime(7, None, None)))
    data[position] = 1
    with pytest.raises(PlanWireError):
        unpack(bytes(data))


def test_zero_is_not_unknown() -> None:
    known = FleetTime(0, 0, Estimate(0, 0))
    assert unpack(pack(known)) == known != unpack(pack(FleetTime(0, None, None)))


def test_the_payload_type_is_for_private_use_and_no_other() -> None:
    assert 32767 < PAYLOAD_TYPE <= 65535
    assert PAYLOAD_TYPE not in (PLAN, AGREEMENTS, UNCERTAINTY)


def test_bytes_are_as_documented() -> None:
    data = pack(FleetTime(0x01020304050607, -2, Estimate(0x0102030405060708, 0x01020304)))
    assert data.hex() == "0103" + "07060504030201" + "fe" + 7 * "ff" + "0807060504030201" + "04030201"
