"""How far a vehicle may be off, on the wire."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.uncertainty import pack, unpack


@given(radius=st.floats(0.0, 655.0))
def test_a_radius_comes_back_never_smaller_and_at_most_a_centimetre_larger(radius):
    assert radius - 1e-9 <= unpack(pack(radius)) <= radius + 0.01 + 1e-9
    assert len(pack(radius)) == 4


def test_what_is_further_than_the_wire_reaches_is_said_as_that():
    assert unpack(pack(1e9)) == unpack(pack(math.inf)) == 655.35


@pytest.mark.parametrize("radius", [-0.01, math.nan, -math.inf])
def test_what_is_no_distance_is_refused(radius):
    with pytest.raises(PlanWireError):
        pack(radius)


@given(data=st.binary(max_size=128))
def test_whatever_arrives_is_a_distance_or_refused(data):
    try:
        assert 0.0 <= unpack(data) <= 655.35
    except PlanWireError:
        assert len(data) < 4 or data[0] != 1


@given(radius=st.floats(0.0, 600.0), more=st.binary(max_size=100))
def test_a_later_sender_may_say_more(radius, more):
    assert unpack(pack(radius) + more) == unpack(pack(radius))
