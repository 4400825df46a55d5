"""Horizons: the paper's recursion, exact between the knots, aligned by time."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.values.horizon import HorizonTable, roll_out
from tests.companion.rig import LAWS, numbers, vectors

EPOCH = 1_767_225_600_000_000
DTS = st.integers(1_000, 65_000).map(lambda k: 4 * k)
ACCELERATIONS = st.integers(1, 16).flatmap(
    lambda n: st.lists(vectors(7.0), min_size=n, max_size=n).map(np.array)
)


@st.composite
def horizons(draw, epoch=EPOCH):
    return roll_out(epoch, draw(DTS), draw(vectors(20.0)), draw(vectors(5.0)), draw(ACCELERATIONS))


@LAWS
@given(dt=DTS, x=vectors(20.0), v=vectors(5.0), a=ACCELERATIONS)
def test_roll_out_is_the_recursion_of_the_paper(dt, x, v, a):
    h = dt * 1e-6
    eye, zero = np.eye(3), np.zeros((3, 3))
    A = np.block([[eye, h * eye], [zero, eye]])
    B = np.vstack([0.5 * h**2 * eye, h * eye])
    horizon = roll_out(EPOCH, dt, x, v, a)
    state = np.concatenate([x, v])
    for n, u in enumerate(a):
        np.testing.assert_allclose(horizon.knots[n, :6], state, atol=1e-9)
        np.testing.assert_array_equal(horizon.knots[n, 6:], u)
        state = A @ state + B @ u
    np.testing.assert_allclose(horizon.knots[-1, :6], state, atol=1e-9)
    assert not horizon.knots[-1, 6:].any()
    assert horizon.end == EPOCH + len(a) * dt


@LAWS
@given(horizon=horizons(), data=st.data())
def test_at_is_the_exact_motion(horizon, data):
    """Constant acceleration from the knot before; before and after the horizon constant velocity."""
    n = data.draw(st.integers(-3, len(horizon.knots) + 2))
    into = data.draw(st.integers(0, horizon.dt - 1))
    motion = horizon.at(horizon.epoch + n * horizon.dt + into)
    inside = 0 <= n < len(horizon.knots) - 1
    k = min(max(n, 0), len(horizon.knots) - 1)
    x, v, a = horizon.knots[k, 0:3], horizon.knots[k, 3:6], horizon.knots[k, 6:9] if inside else np.zeros(3)
    s = ((n - k) * horizon.dt + into) * 1e-6
    np.testing.assert_allclose(motion.position, x + v * s + 0.5 * a * s**2, atol=1e-9)
    np.testing.assert_allclose(motion.velocity, v + a * s, atol=1e-9)
    np.testing.assert_array_equal(motion.acceleration, a)


@LAWS
@given(horizon=horizons())
def test_at_is_continuous_at_every_knot(horizon):
    for n in range(len(horizon.knots)):
        time = horizon.epoch + n * horizon.dt
        before, at = horizon.at(time - 1), horizon.at(time)
        # Within one µs, by no more than speed and acceleration allow.
        np.testing.assert_allclose(at.position, before.position + 1e-6 * before.velocity, atol=1e-10)
        np.testing.assert_allclose(at.velocity, before.velocity + 1e-6 * before.acceleration, atol=1e-9)
        np.testing.assert_allclose(at.position, horizon.knots[n, 0:3], atol=1e-9)


@LAWS
@given(horizon=horizons(), late=st.integers(0, 3_000_000), steps=st.integers(1, 17), dt=DTS)
def test_positions_are_those_of_at(horizon, late, steps, dt):
    start = horizon.epoch + late
    expected = [horizon.at(start + n * dt).position for n in range(steps)]
    np.testing.assert_allclose(horizon.positions(start, steps, dt), expected, atol=1e-9)


@LAWS
@given(horizon=horizons(), shift=st.integers(-(10**14), 10**14), late=st.integers(0, 2_000_000))
def test_shifting_epoch_and_time_together_changes_nothing(horizon, shift, late):
    moved = horizon._replace(epoch=horizon.epoch + shift)
    start = horizon.epoch + late
    np.testing.assert_array_equal(
        moved.positions(start + shift, 16, 100_000), horizon.positions(start, 16, 100_000)
    )
    for one, other in zip(moved.at(start + shift), horizon.at(start), strict=True):
        np.testing.assert_array_equal(one, other)
    tables = HorizonTable(16, 100_000), HorizonTable(16, 100_000)
    tables[0].put(1, horizon)
    tables[1].put(1, moved)
    np.testing.assert_array_equal(
        tables[0].positions([1], start, start - 10**7)[0],
        tables[1].positions([1], start + shift, start + shift - 10**7)[0],
    )


@LAWS
@given(horizon=horizons(), knots=st.integers(0, 16))
def test_a_horizon_that_started_earlier_tells_of_the_same_motion(horizon, knots):
    """What a neighbour knows of a delayed plan is the plan made anew from its state by now."""
    knots = min(knots, len(horizon.knots) - 2)
    rest = roll_out(
        horizon.epoch + knots * horizon.dt,
        horizon.dt,
        horizon.knots[knots, 0:3],
        horizon.knots[knots, 3:6],
        horizon.knots[knots:-1, 6:9],
    )
    start = rest.epoch + horizon.dt // 3
    np.testing.assert_allclose(
        rest.positions(start, 16, horizon.dt), horizon.positions(start, 16, horizon.dt), atol=1e-9
    )


@LAWS
@given(
    fleet=st.dictionaries(
        st.integers(1, 255),
        horizons().flatmap(
            lambda h: st.integers(-500_000, 500_000).map(lambda e: h._replace(epoch=h.epoch + e))
        ),
        min_size=1,
        max_size=6,
    ),
    dt=DTS,
)
def test_a_table_samples_every_sender_as_its_own_horizon(fleet, dt):
    table = HorizonTable(16, dt)
    for sender, horizon in fleet.items():
        table.put(sender, horizon)
    start, oldest = EPOCH + 600_000, EPOCH - 100_000
    senders = [*fleet, 256]
    positions, known = table.positions(senders, start, oldest)
    assert positions.shape == (len(senders), 16, 3)
    assert not known[-1]
    for row, (sender, horizon) in enumerate(fleet.items()):
        assert known[row] == (horizon.epoch >= oldest), sender
        np.testing.assert_allclose(positions[row], horizon.positions(start, 16, dt), atol=1e-9)


@LAWS
@given(horizon=horizons(), early=st.integers(1, 100_000))
def test_a_table_carries_a_horizon_that_is_yet_to_begin_back_at_constant_velocity(horizon, early):
    table = HorizonTable(16, 100_000)
    table.put(1, horizon)
    positions, _ = table.positions([1], horizon.epoch - early, horizon.epoch)
    expected = [horizon.at(horizon.epoch - early + n * 100_000).position for n in range(16)]
    np.testing.assert_allclose(positions[0], expected, atol=1e-9)


@LAWS
@given(old=horizons(), new=horizons(), gap=st.integers(1, 10**7), offset=numbers(1.0, 5.0))
def test_a_table_keeps_the_latest_whatever_arrives_last(old, new, gap, offset):
    new = new._replace(epoch=old.epoch + gap)
    tables = HorizonTable(16, 100_000), HorizonTable(16, 100_000)
    for table, order in zip(tables, ([old, new], [new, old]), strict=True):
        for horizon in order:
            table.put(7, horizon)
        positions, known = table.positions([7], new.epoch, new.epoch)
        assert known.all()
        np.testing.assert_allclose(positions[0], new.positions(new.epoch, 16, 100_000), atol=1e-9)


def test_an_empty_table_knows_nobody():
    positions, known = HorizonTable(16, 100_000).positions([3, 4], EPOCH, 0)
    assert positions.shape == (2, 16, 3)
    assert not known.any()


@LAWS
@given(
    fleet=st.dictionaries(st.integers(1, 250), horizons(), max_size=5),
    unknown=st.sets(st.integers(251, 255)),
    data=st.data(),
)
def test_a_table_locates_each_sender_at_a_time_of_its_own(fleet, unknown, data):
    table = HorizonTable(1, 4)
    for sender, horizon in fleet.items():
        table.put(sender, horizon)
    senders = data.draw(st.permutations([*fleet, *sorted(unknown)]))
    times = EPOCH + np.array([data.draw(st.integers(-3_000_000, 9_000_000)) for _ in senders], np.int64)
    found = table.at(senders, times)
    assert found.positions.shape == (len(senders), 3)
    for sender, time, position, after, dt in zip(senders, times.tolist(), *found, strict=True):
        if sender in unknown:
            assert after > 3_000_000_000
            continue
        assert (after, dt) == (time - EPOCH, fleet[sender].dt)
        np.testing.assert_allclose(position, fleet[sender].at(time).position, atol=1e-9)


@LAWS
@given(fleet=st.dictionaries(st.integers(1, 250), horizons(), max_size=5))
def test_a_table_says_when_and_where_each_horizon_begins(fleet):
    table = HorizonTable(1, 4)
    for sender, horizon in fleet.items():
        table.put(sender, horizon)
    begun, states = table.starts((*fleet, 251))
    for row, horizon in enumerate(fleet.values()):
        assert begun[row] == horizon.epoch
        np.testing.assert_array_equal(states[row], horizon.knots[0, 0:6])
    assert begun[-1] < -EPOCH
    assert not states[-1].any()


@LAWS
@given(fleet=st.dictionaries(st.integers(1, 250), horizons(), max_size=5), data=st.data())
def test_a_table_says_what_each_sender_means_to_accelerate(fleet, data):
    """Before its plan begins, what that begins with; nothing after it, nor of one without a plan."""
    table = HorizonTable(1, 4)
    for sender, horizon in fleet.items():
        table.put(sender, horizon)
    senders = [*fleet, 251]
    times = EPOCH + np.array([data.draw(st.integers(-3_000_000, 9_000_000)) for _ in senders], np.int64)
    meant = table.accelerations(senders, times)
    np.testing.assert_array_equal(meant[-1], 0.0)
    for sender, time, a in zip(fleet, times.tolist(), meant, strict=False):
        np.testing.assert_array_equal(a, fleet[sender].at(max(time, EPOCH)).acceleration)
