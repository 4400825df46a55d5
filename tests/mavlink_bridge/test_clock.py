"""Clocks never run backwards."""

from __future__ import annotations

import time

from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.clock import Clock, SimulatedClock, SkewedClock, WallClock
from mavlink_bridge.node_clock import NodeClock


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
