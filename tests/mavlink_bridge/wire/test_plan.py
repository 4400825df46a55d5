"""Laws of the plan on the wire: exact integers there and back, an exact shift, a bounded rounding error."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.plan import KNOTS, PAYLOAD_TYPE, WirePlan, pack, quantise, unpack


def signed(bits: int) -> st.SearchStrategy[int]:
    return st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def triple(bits: int) -> st.SearchStrategy[tuple[int, int, int]]:
    return st.tuples(signed(bits), signed(bits), signed(bits))


plans = st.builds(
    WirePlan,
    st.integers(0, 2**56 - 1),
    st.integers(1, 65535).map(lambda steps: steps * 4),
    triple(32),
    triple(24),
    st.lists(triple(16), max_size=KNOTS).map(tuple),
    st.integers(0, 255),
    st.booleans(),
)


@given(plans)
def test_round_trip_is_exact(plan: WirePlan) -> None:
    data = pack(plan)
    assert len(data) == 32 + 6 * len(plan.accelerations) <= 128
    assert unpack(data) == plan
    assert pack(unpack(data)) == data


@given(st.binary(max_size=140))
def test_other_bytes_are_refused_or_are_a_plan(data: bytes) -> None:
    try:
        plan = unpack(data)
    except PlanWireError:
        return
    assert pack(plan) == data


@given(plans, st.integers(0, 127), st.integers(1, 255))
def test_changed_bytes_are_refused_or_are_another_plan(plan: WirePlan, at: int, flip: int) -> None:
    data = bytearray(pack(plan))
    data[at % len(data)] ^= flip
    try:
        other = unpack(bytes(data))
    except PlanWireError:
        return
    assert other != plan
    assert pack(other) == bytes(data)


@given(plans)
def test_states_obey_the_motion_exactly(plan: WirePlan) -> None:
    states = plan.states()
    assert states.shape == (len(plan.accelerations) + 1, 2, 3)
    assert states.dtype == np.int64
    assert (*states[0, 0],) == plan.position
    assert (*states[0, 1],) == plan.velocity
    for (p, v), (p_next, v_next), a in zip(states, states[1:], plan.accelerations, strict=False):
        assert np.array_equal(p_next, p + 2 * v + a)
        assert np.array_equal(v_next, v + a)


@given(plans, st.data())
def test_a_shift_is_the_same_motion_seen_later(plan: WirePlan, data: st.DataObject) -> None:
    knots = data.draw(st.integers(0, len(plan.accelerations)))
    rest = plan.shifted(knots)
    assert np.array_equal(rest.states(), plan.states()[knots:])
    assert rest.epoch == plan.epoch + knots * plan.dt
    assert rest.shifted(0) == rest
    further = data.draw(st.integers(0, len(rest.accelerations)))
    assert rest.shifted(further) == plan.shifted(knots + further)


@pytest.mark.parametrize("knots", [-1, 3])
def test_no_shift_beyond_the_plan(knots: int) -> None:
    with pytest.raises(PlanWireError):
        WirePlan(0, 4, (0, 0, 0), (0, 0, 0), ((1, 1, 1), (2, 2, 2)), 0).shifted(knots)


metres = st.floats(-2600, 2600)
speeds = st.floats(-20, 20)
accelerations = st.floats(-6, 6)


def vector(of: st.SearchStrategy[float]) -> st.SearchStrategy[tuple[float, float, float]]:
    return st.tuples(of, of, of)


@given(
    st.sampled_from([50_000, 100_000, 200_000, 250_000]),
    vector(metres),
    vector(speeds),
    st.lists(vector(accelerations), min_size=1, max_size=KNOTS),
)
def test_rounding_stays_within_half_a_unit_each(
    dt: int,
    position: tuple[float, float, float],
    velocity: tuple[float, float, float],
    knots: list[tuple[float, float, float]],
) -> None:
    plan = quantise(1_700_000_000_000_000, dt, position, velocity, knots, 9)
    seconds, slack = dt * 1e-6, 1 + 1e-9
    unit = 0.5e-3 * seconds**2
    assert np.abs(plan.position_m - position).max() <= unit / 2 * slack + 1e-12
    assert np.abs(plan.velocity_m_s - velocity).max() <= 0.5e-3 * seconds * slack + 1e-12
    assert np.abs(plan.accelerations_m_s2 - np.array(knots)).max() <= 0.5e-3 * slack + 1e-12
    p, v = np.array(position), np.array(velocity)
    exact_p, exact_v = [p], [v]
    for a in np.array(knots):
        p = p + v * seconds + 0.5 * a * seconds**2
        v = v + a * seconds
        exact_p.append(p)
        exact_v.append(v)
    n = np.arange(len(knots) + 1)[:, None]
    bound = (0.5 + n + 0.5 * n**2) * unit
    assert np.all(np.abs(plan.positions_m() - exact_p) <= bound * slack + 1e-9)
    assert np.all(np.abs(plan.velocities_m_s() - exact_v) <= 0.5e-3 * seconds * (1 + n) * slack + 1e-9)


@given(plans)
def test_quantising_what_a_plan_says_gives_the_plan(plan: WirePlan) -> None:
    again = quantise(
        plan.epoch, plan.dt, plan.position_m, plan.velocity_m_s, plan.accelerations_m_s2, plan.origin
    )
    assert again == plan._replace(column=False)


def good(**changes: object) -> dict[str, object]:
    base: dict[str, object] = {
        "epoch": 0,
        "dt": 100_000,
        "position": (1.0, 2.0, 3.0),
        "velocity": (0.1, 0.2, 0.3),
        "accelerations": np.zeros((3, 3)),
        "origin": 1,
    }
    return base | changes


@pytest.mark.parametrize(
    "changes",
    [
        {"position": (math.nan, 0, 0)},
        {"position": (1e5, 0, 0)},
        {"position": (1e300, 0, 0)},
        {"position": (0.0, 0.0)},
        {"velocity": (0, math.inf, 0)},
        {"velocity": (0, 1e4, 0)},
        {"accelerations": np.full((3, 3), math.nan)},
        {"accelerations": np.full((3, 3), 33.0)},
        {"accelerations": np.zeros((KNOTS + 1, 3))},
        {"accelerations": np.zeros((3, 2))},
        {"dt": 0},
        {"dt": 100_002},
        {"dt": 400_000},
        {"epoch": -1},
        {"epoch": 2**56},
        {"origin": 256},
    ],
    ids=str,
)
def test_what_does_not_fit_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(PlanWireError):
        quantise(**good(**changes))  # type: ignore[arg-type]


def test_the_payload_type_is_for_private_use() -> None:
    assert 32767 < PAYLOAD_TYPE <= 65535


def test_bytes_are_little_endian_as_documented() -> None:
    plan = WirePlan(0x01020304050607, 4 * 0x0A0B, (1, -1, 2), (3, -3, 4), ((5, -5, 6),), 0xAB)
    assert pack(plan).hex() == (
        "01ab0b0a07060504030201" + "01000000ffffffff02000000" + "030000fdffff040000" + "0500fbff0600"
    )
