"""Goals on the wire: what is sent is received, to half a millimetre, and nothing else is taken for one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.goal import goal_at, pack, room_to, unpack

METRES = st.floats(-2e6, 2e6)
SIZES = {15: 1, 28: 2}
"""Kinds by size in bytes."""


@given(st.tuples(METRES, METRES, METRES), st.integers(0, 255), st.booleans())
def test_a_goal_arrives_to_half_a_millimetre(
    place: tuple[float, float, float], origin: int, reached: bool
) -> None:
    found = unpack(pack(goal_at(np.array(place), origin, reached=reached)))
    assert found.origin == origin
    assert found.reached == reached
    assert np.abs(found.position_m - place).max() <= 0.5e-3 + 1e-9


@given(st.tuples(METRES, METRES, METRES), st.tuples(METRES, METRES, METRES), st.integers(0, 255))
def test_a_vehicle_that_asks_for_room_tells_its_next_place_and_rank_beside_its_goal(
    place: tuple[float, float, float], onwards: tuple[float, float, float], rank: int
) -> None:
    found = unpack(pack(goal_at(np.array(place), 7, room=room_to(np.array(onwards), rank))))
    assert found.room is not None
    assert found.room.rank == rank
    assert np.abs(found.position_m - place).max() <= 0.5e-3 + 1e-9
    assert np.abs(found.room.next_place_m - onwards).max() <= 0.5e-3 + 1e-9


@pytest.mark.parametrize("place", [[np.nan, 0.0, 0.0], [0.0, np.inf, 0.0], [0.0, 0.0, 3e6]])
def test_what_is_no_place_is_refused(place: list[float]) -> None:
    with pytest.raises(PlanWireError, match="not finite or too far"):
        goal_at(np.array(place), 0)
    with pytest.raises(PlanWireError, match="not finite or too far"):
        room_to(np.array(place), 0)


@given(
    st.binary(max_size=40)
    | st.builds(bytes.__add__, st.sampled_from([b"\x01", b"\x02"]), st.binary(min_size=14, max_size=27))
)
def test_other_bytes_are_refused_or_a_goal(payload: bytes) -> None:
    try:
        found = unpack(payload)
    except PlanWireError:
        assert len(payload) not in SIZES or payload[0] != SIZES[len(payload)] or payload[2] > 1
    else:
        assert pack(found) == payload
