"""Clocks never run backwards."""

from __future__ import annotations

import time

from mavlink_bridge.clock import Clock, SimulatedClock, WallClock


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
