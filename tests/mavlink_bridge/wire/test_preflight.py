"""Messages of a check before a flight: exact there and back; other bytes are refused or another message."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.preflight import (
    LINKS_PER_PART,
    MOST,
    LinkReport,
    Probe,
    Report,
    Stage,
    Turn,
    pack,
    unpack,
)

words = st.integers(0, 2**32 - 1)
tenths = st.integers(0, MOST)
halves = st.integers(0, 65_535)
STATED, UNKNOWN = (True, True, True), (None, None, None)
probes = st.builds(Probe, words, words, words, st.integers(0, 2**56 - 1))
turns = st.builds(Turn, words, words, st.sampled_from(Stage), st.booleans())
links = st.builds(LinkReport, st.integers(1, 255), st.integers(0, 10_000), tenths, st.none() | tenths)


@st.composite
def reports(draw: st.DrawFn) -> Report:
    parts = draw(st.integers(1, 255))
    return Report(
        draw(words),
        draw(words),
        draw(st.booleans()),
        draw(st.tuples(st.booleans(), st.booleans(), st.booleans())),
        draw(st.integers(0, parts - 1)),
        parts,
        draw(st.integers(0, 255)),
        draw(words),
        draw(st.tuples(st.none() | halves, st.none() | words, st.none() | halves)),
        tuple(draw(st.lists(links, max_size=LINKS_PER_PART))),
    )


@given(probes | turns | reports())
def test_round_trip_is_exact_and_fits_a_tunnel(message: Probe | Report | Turn) -> None:
    data = pack(message)
    assert len(data) <= 128
    assert unpack(data) == message


@given(probes)
def test_a_probe_has_the_size_of_the_largest_plan(probe: Probe) -> None:
    assert len(pack(probe)) == 128


@given(
    st.binary(max_size=130)
    | st.binary(max_size=126).map(lambda data: b"\x02" + data)
    | st.binary(min_size=10, max_size=10).map(lambda data: b"\x03" + data)
)
def test_other_bytes_are_refused_or_are_a_message(data: bytes) -> None:
    try:
        message = unpack(data)
    except PlanWireError:
        return
    assert pack(message) == data


@given(probes | turns | reports(), st.integers(0, 8 * 128 - 1))
def test_one_bit_makes_it_another_or_none(message: Probe | Report | Turn, bit: int) -> None:
    data = bytearray(pack(message))
    data[bit // 8 % len(data)] ^= 1 << bit % 8
    try:
        other = unpack(bytes(data))
    except PlanWireError:
        return
    assert other != message


@pytest.mark.parametrize(
    "bad",
    [
        Probe(2**32, 0, 0, 0),
        Probe(0, 0, 0, 2**56),
        Report(0, 0, True, STATED, 1, 1, 3, 0, UNKNOWN, ()),
        Report(0, 0, True, STATED, 0, 1, 3, 0, (65_536, None, None), ()),
        Report(0, 0, True, STATED, 0, 1, 3, 0, UNKNOWN, (LinkReport(1, 0, 0, 0),) * 20),
    ],
)
def test_what_does_not_fit_is_refused(bad: Probe | Report) -> None:
    with pytest.raises(PlanWireError):
        pack(bad)
