"""Late measurements: whatever the order of arrival, the same track comes of the same measurements, bit by
bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.estimation import TrackConfig
from companion.estimation.estimator import Estimator
from companion.estimation.out_of_sequence import OutOfSequenceBuffer
from companion.estimation.sender_clock import TrackTime
from companion.estimation.tracks import Track
from tests.companion.rig import LAWS, QUICK, numbers, vectors

CONFIG = TrackConfig(sigma_turn=0.5)
WINDOW = CONFIG.rewind_us
BOOT = 3_000_000_000
"""µs; what the sender's clock says less than ours."""
FIRST = 5_000_000
STILL = (0.0,) * 6
TELEPORT = np.array([20.0, -30.0, 5.0])


@st.composite
def received(draw):
    """Measurements (stamp, position, velocity) with noise and teleports, and how late each arrives, below the
    window."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    steps = draw(st.lists(st.integers(1, 200), min_size=3, max_size=40))
    stamps = FIRST + 1000 * np.cumsum(steps)
    away = draw(st.sets(st.integers(0, len(steps) - 1), max_size=8))
    most = draw(st.sampled_from([0, 100_000, 600_000, WINDOW - 1]))
    late = [int(random.integers(0, most + 1)) for _ in steps]
    # One that is not late at all, so that both orders know the same offset of the clocks.
    late[0] = 0
    measured = []
    for k, stamp in enumerate(stamps.tolist()):
        x = 3e-6 * stamp * np.ones(3) + 0.05 * random.normal(size=3) + (TELEPORT if k in away else 0.0)
        measured.append((stamp, x, 3.0 + 0.1 * random.normal(size=3)))
    return measured, late


def listened(measured, late):
    """A track that heard them in the order in which they arrived."""
    track = Track(CONFIG)
    order = sorted(range(len(measured)), key=lambda k: (measured[k][0] + late[k], k))
    for k in order:
        stamp, x, v = measured[k]
        track.measure(BOOT + stamp + late[k], x, v, stamp)
    return track


def assert_same(one, other):
    np.testing.assert_array_equal(one.last, other.last)
    np.testing.assert_array_equal(one.covariance(), other.covariance())
    assert one.rejected == other.rejected
    assert one.at(one.time).turn_rate == other.at(other.time).turn_rate


@LAWS
@given(flight=received())
def test_out_of_order_equals_in_order_exactly(flight):
    measured, late = flight
    in_order = listened(measured, [0] * len(late))
    out_of_order = listened(measured, late)
    assert_same(out_of_order, in_order)


@LAWS
@given(flight=received(), ahead=st.integers(0, 2_000_000))
def test_the_answers_are_the_same_too_while_the_clocks_are(flight, ahead):
    """Before there is a rate, the least lag is that of the first: same time, same state, same sigma."""
    measured, late = flight[0][:5], flight[1][:5]
    in_order, out_of_order = listened(measured, [0] * len(late)), listened(measured, late)
    assert out_of_order.time == in_order.time
    now = BOOT + measured[-1][0] + ahead
    for one, other in zip(out_of_order.at(now), in_order.at(now), strict=True):
        np.testing.assert_array_equal(one, other)


@LAWS
@given(flight=received(), again=st.lists(st.tuples(st.integers(0, 39), st.integers(0, 300_000)), max_size=20))
def test_duplicates_count_once(flight, again):
    measured, _ = flight
    once = listened(measured, [0] * len(measured))
    copies = [(k, late) for k, late in again if k < len(measured)]
    # No more than two copies of each: the fourth in a row would tell of a clock that stands.
    copies = [pair for i, pair in enumerate(copies) if [k for k, _ in copies[:i]].count(pair[0]) < 2]
    several = listened(
        [*measured, *(measured[k] for k, _ in copies)], [0] * len(measured) + [late for _, late in copies]
    )
    assert_same(several, once)


@QUICK
@given(data=st.data(), x=vectors(50.0))
def test_any_order_of_insertion_within_the_window(data, x):
    """Without clocks: every permutation that keeps within the window of the newest."""
    times = sorted(data.draw(st.sets(st.integers(0, WINDOW // 1000), min_size=2, max_size=12)))
    order = data.draw(st.permutations(times))
    far = data.draw(st.sets(st.sampled_from(times), max_size=4))
    results = []
    for turn in (times, order):
        rewind = OutOfSequenceBuffer(Estimator(CONFIG), WINDOW)
        for time in turn:
            z = (*(x + (TELEPORT if time in far else 0.0)).tolist(), 0.0, 0.0, 0.0)
            rewind.put(TrackTime(1000 * time, True), z)
        results.append(rewind.belief)
    one, other = results
    assert one == other


@LAWS
@given(late=st.integers(1, 10**7), x=vectors(50.0))
def test_older_than_the_window_is_refused_and_counted(late, x):
    rewind = OutOfSequenceBuffer(Estimator(CONFIG), WINDOW)
    for k in range(60):
        rewind.put(TrackTime(k * 100_000, True), STILL)
    before = rewind.belief
    newest = 59 * 100_000
    assert not rewind.put(TrackTime(newest - WINDOW - late, True), (*x.tolist(), *x.tolist()))
    assert rewind.too_late == 1
    assert rewind.belief is before
    # The last one that still counts.
    assert rewind.put(TrackTime(newest - WINDOW + 1, True), STILL)
    assert rewind.too_late == 1


def test_a_late_message_can_be_the_first_of_all():
    """The track begins anew with what was true before its beginning."""
    z = [(k * 0.3, 0.0, 0.0, 3.0, 0.0, 0.0) for k in range(3)]
    beliefs = []
    for order in ((0, 1, 2), (1, 2, 0), (2, 1, 0)):
        rewind = OutOfSequenceBuffer(Estimator(CONFIG), WINDOW)
        for k in order:
            assert rewind.put(TrackTime(k * 100_000, True), z[k])
        beliefs.append(rewind.belief)
    assert beliefs[0] == beliefs[1] == beliefs[2]


@pytest.mark.parametrize("missing", [39, 40, 45, 59])
def test_a_late_message_can_be_the_oldest_that_is_remembered(missing):
    """What was believed before the window is what it is taken after."""
    random = np.random.default_rng(3)
    measured = (
        [TrackTime(k * 100_000, True) for k in range(60)],
        random.normal(scale=0.02, size=(60, 6)).tolist(),
    )
    in_order, late = (OutOfSequenceBuffer(Estimator(CONFIG), WINDOW) for _ in range(2))
    for k, (dated, z) in enumerate(zip(*measured, strict=True)):
        in_order.put(dated, tuple(z))
        if k != missing:
            late.put(dated, tuple(z))
    assert late.belief != in_order.belief
    late.put(measured[0][missing], tuple(measured[1][missing]))
    assert late.belief == in_order.belief


def test_a_late_witness_turns_the_verdict_on_those_after_it():
    """Two agree on a jump, but the first of them comes last: the second is then believed, as in order."""
    track = Track(CONFIG)
    for k in range(5):
        assert track.measure(BOOT + FIRST + k * 100_000, np.zeros(3), np.zeros(3), FIRST + k * 100_000)
    assert not track.measure(BOOT + FIRST + 600_000, TELEPORT, np.zeros(3), FIRST + 600_000)
    assert track.rejected == 1
    track.measure(BOOT + FIRST + 610_000, TELEPORT, np.zeros(3), FIRST + 500_000)
    assert track.rejected == 1
    np.testing.assert_allclose(track.last[:3], TELEPORT)


@QUICK
@given(seed=st.integers(0, 2**32 - 1), window=st.integers(0, 3_000_000), spread=numbers(0.0, 4e6))
def test_the_memory_stays_within_two_windows_whatever_comes(seed, window, spread):
    random = np.random.default_rng(seed)
    rewind = OutOfSequenceBuffer(Estimator(CONFIG), window)
    newest = None
    for k in range(100):
        time = int(k * 100_000 + spread * random.uniform(-1.0, 1.0))
        rewind.put(TrackTime(time, True), tuple(random.normal(size=6).tolist()))
        newest = time if newest is None else max(time, newest)
        assert rewind._times == sorted(set(rewind._times))
        assert rewind._times[-1] == newest
        assert rewind._times[0] >= newest - 2 * window
        assert len(rewind._times) == len(rewind._beliefs) == len(rewind._measured)
