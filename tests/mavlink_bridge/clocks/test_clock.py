"""Clocks never run backwards."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.clocks.clock import Clock, PacedClock, SimulatedClock, SkewedClock, WallClock
from mavlink_bridge.clocks.node_clock import NodeClock


def test_simulated_time_jumps_forward_only() -> None:
    clock: Clock = SimulatedClock(100)
    assert clock.now() == 100
    clock.wait_until(5000)
    assert clock.now() == 5000
    clock.wait_until(200)
    assert clock.now() == 5000


def test_the_wall_clock_tells_unix_time_and_never_decreases() -> None:
    clock: Clock = WallClock()
    readings = [clock.now() for _ in range(1000)]
    assert readings == sorted(readings)
    assert abs(readings[0] - time.time_ns() // 1000) < 60_000_000
    clock.wait_until(readings[0])
    target = clock.now() + 200
    clock.wait_until(target)
    assert clock.now() >= target


def test_clocks_with_one_offset_agree() -> None:
    one = WallClock()
    other = WallClock(one.offset_ns)
    readings = [clock.now() for _ in range(100) for clock in (one, other)]
    assert readings == sorted(readings)
    later = WallClock(one.offset_ns + 7_000_000_000_000)
    before = one.now()
    assert later.now() - before >= 7_000_000_000


@given(
    st.integers(-(10**7), 10**7),
    st.floats(-500.0, 500.0),
    st.lists(st.integers(0, 10**7), min_size=1, max_size=20),
)
def test_who_waits_on_a_skewed_clock_wakes_when_it_shows_the_time(
    offset: int, drift_ppm: float, waits: list[int]
) -> None:
    true = SimulatedClock(10**9)
    clock: Clock = SkewedClock(true, NodeClock(offset, drift_ppm, 10**9))
    for wait in waits:
        before, target = true.now(), clock.now() + wait
        clock.wait_until(target)
        assert target <= clock.now() <= target + 1
        # Slow or fast by 500 ppm at most.
        assert abs((true.now() - before) - wait) <= wait * 0.000501 + 2


SPEEDS = st.floats(0.01, 1000.0)
# µs of wall time that pass between two waits, and how far (µs, simulated) one then waits.
TURNS = st.lists(st.tuples(st.integers(0, 10**7), st.integers(-(10**5), 10**7)), max_size=20)


@given(SPEEDS, st.integers(1, 10**6), TURNS)
def test_paced_time_never_goes_back_and_no_stride_is_longer_than_allowed(
    speed: float, stride: int, turns: list[tuple[int, int]]
) -> None:
    wall = SimulatedClock(10**15)
    clock = PacedClock(wall, speed, stride)
    readings = [clock.now()]
    assert readings == [0]
    for busy, ahead in turns:
        woken = clock.now()
        wall.wait_until(wall.now() + busy)
        readings.append(clock.now())
        assert readings[-1] - woken <= stride
        target = clock.now() + ahead
        clock.wait_until(target)
        readings.append(clock.now())
        assert readings[-1] >= target
        # It oversleeps by the rounding of one µs of the wall at most.
        assert readings[-1] <= max(target, readings[-2]) + 2 * speed + 2
    assert readings == sorted(readings)
    assert clock.lost >= 0


@given(SPEEDS, TURNS)
def test_paced_time_keeps_its_speed_as_long_as_nothing_is_lost(
    speed: float, turns: list[tuple[int, int]]
) -> None:
    wall = SimulatedClock(10**15)
    clock = PacedClock(wall, speed, 10**12)
    for busy, ahead in turns:
        wall.wait_until(wall.now() + busy)
        clock.wait_until(clock.now() + ahead)
        assert abs(clock.now() - (wall.now() - 10**15) * speed) <= 1
    assert clock.lost == 0


def test_what_is_lost_is_what_is_missing() -> None:
    wall = SimulatedClock(0)
    clock = PacedClock(wall, 2.0, 1_000)
    wall.wait_until(10_000)
    assert clock.now() == 1_000
    assert clock.lost == 19_000
    clock.wait_until(1_500)
    assert wall.now() == pytest.approx(10_250, abs=2)


class Common:
    """An account that several clocks share."""

    lost = 0


TOGETHER = st.lists(st.tuples(st.booleans(), st.integers(0, 10**6), st.integers(0, 10**5)), max_size=20)


@given(SPEEDS, st.integers(1, 10**6), TOGETHER)
def test_who_share_an_account_live_in_one_time(
    speed: float, stride: int, turns: list[tuple[bool, int, int]]
) -> None:
    wall, account = SimulatedClock(10**15), Common()
    one, other = (PacedClock(wall, speed, stride, account) for _ in range(2))
    for first, busy, ahead in turns:
        clock = one if first else other
        wall.wait_until(wall.now() + busy)
        before = clock.now(), account.lost
        clock.wait_until(before[0] + ahead)
        # What is lost is lost for both, once; time goes back for neither.
        assert clock.now() >= before[0]
        assert account.lost >= before[1]
        assert one.lost == other.lost
    for clock in (one, other):
        clock.wait_until(max(one.now(), other.now()))
    assert abs(one.now() - other.now()) <= stride
