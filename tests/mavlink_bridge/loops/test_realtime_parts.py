"""What the loop is helped by: figures in constant memory, idle time for garbage, and the system's favour."""

from __future__ import annotations

import gc
import math
import os
import subprocess
import sys
import time
import weakref

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.loops import priority
from mavlink_bridge.loops.garbage import IdleCollector, seldom_collected
from mavlink_bridge.loops.histogram import Histogram, Spread
from mavlink_bridge.loops.priority import LEVEL, Priority, ask_for_priority

VALUES = st.lists(st.one_of(st.integers(0, 200), st.integers(0, 2**45 - 1)), max_size=60)


def counted(values: list[int]) -> Histogram:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    return histogram


@given(VALUES.filter(bool), st.floats(0.001, 1.0))
def test_quantiles_are_at_most_a_thirtysecond_too_high(values: list[int], fraction: float) -> None:
    exact = sorted(values)[math.ceil(fraction * len(values)) - 1]
    found = counted(values).quantile(fraction)
    assert exact <= found <= exact + exact // 32
    assert counted(values).quantile(1.0) == max(values)


@given(VALUES, VALUES)
def test_histograms_add_up(one: list[int], other: list[int]) -> None:
    both = counted(one)
    both.include(counted(other))
    together = counted(one + other)
    for fraction in (0.01, 0.5, 0.9, 0.99, 1.0):
        assert both.quantile(fraction) == together.quantile(fraction)
    assert both.spread == together.spread
    assert both.count == len(one) + len(other)


def test_extremes_are_counted() -> None:
    assert Histogram().spread == Spread(0, 0, 0)
    histogram = counted([-5, 2**80])
    assert histogram.quantile(0.5) == 0
    assert histogram.max == 2**80
    assert histogram.count == 2


class Ring:
    """Refers to itself, so that only a collector gets rid of it."""

    def __init__(self) -> None:
        self.self = self


def litter(count: int) -> weakref.ref[Ring]:
    rings = [Ring() for _ in range(count)]
    return weakref.ref(rings[-1])


def test_garbage_goes_when_there_is_time_and_only_then() -> None:
    with IdleCollector() as collector:
        assert not gc.isenabled()
        ring = litter(2_000)
        collector.idle(100)
        collector.idle(-1)
        assert ring() is not None
        assert collector.collections == 0
        collector.idle(10**9)
        assert ring() is None
        assert collector.collections == 1
        collector.idle(10**9)
        assert collector.collections == 1
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_a_lot_of_garbage_goes_even_without_time() -> None:
    with IdleCollector() as collector:
        ring = litter(80_000)
        collector.idle(-1)
        assert ring() is None


def test_what_survives_often_is_looked_at_less_often_but_is_looked_at() -> None:
    with IdleCollector() as collector:
        rings = [Ring() for _ in range(800)]
        old = weakref.ref(rings[0])
        for turn in range(110):
            keep: list[list[int]] = [[] for _ in range(800)]
            collector.idle(10**9)
            del keep
            if turn == 20:
                del rings
            assert (old() is None) == (turn >= 99)


def test_a_collector_that_was_off_stays_off() -> None:
    gc.disable()
    try:
        with IdleCollector():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_seldom_is_not_never_and_ends() -> None:
    before = gc.get_threshold()
    with seldom_collected():
        ring = litter(2_000)
        assert ring() is not None
        # Containers that stay: so much that is new calls for a look.
        kept = [[number] for number in range(200_000)]
        assert ring() is None
        assert len(kept) == 200_000
    assert gc.get_threshold() == before
    assert gc.get_freeze_count() == 0


# Priority


def refuse(error: OSError) -> object:
    def refusal(*_: object) -> None:
        raise error

    return refusal


@pytest.mark.skipif(sys.platform != "linux", reason="Linux only")
@pytest.mark.parametrize(
    ("error", "words"),
    [
        (
            PermissionError(1, "Operation not permitted"),
            ["ulimit -r", "CAP_SYS_NICE", "docker run --cap-add"],
        ),
        (OSError(22, "Invalid argument"), ["Invalid argument"]),
    ],
)
def test_a_refusal_is_a_sentence_with_a_remedy(
    monkeypatch: pytest.MonkeyPatch, error: OSError, words: list[str]
) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", refuse(error))
    monkeypatch.setattr(priority, "sharpen_timers", lambda: True)
    granted = ask_for_priority()
    assert not granted.realtime
    assert not granted.locked
    assert all(word in granted.told for word in words)
    assert "\n" not in granted.told


def test_a_system_without_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    assert ask_for_priority() == Priority(False, False, "no real-time priority: it needs Linux")


@pytest.mark.skipif(sys.platform != "linux", reason="Linux only")
def test_what_is_said_is_what_was_granted() -> None:
    """In a process of its own, as it cannot be undone; threads must have what the first one got."""
    program = """
import os, threading
from mavlink_bridge.loops.priority import ask_for_priority
granted = ask_for_priority()
seen = []
thread = threading.Thread(target=lambda: seen.append((os.sched_getscheduler(0), os.sched_getparam(0))))
thread.start()
thread.join()
(policy, parameters), = seen
print(granted.realtime, policy == os.SCHED_FIFO, parameters.sched_priority, granted.told)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    realtime, fifo, level, told = done.stdout.split(maxsplit=3)
    assert realtime == fifo
    assert int(level) == (LEVEL if fifo == "True" else 0)
    assert ("SCHED_FIFO" in told) == (fifo == "True")


def test_an_older_generation_without_time_does_not_hold_up_the_youngest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock, taken = [0], []

    def collect(generation: int = 2) -> int:
        taken.append(generation)
        clock[0] += 10_000_000 if generation else 100_000
        return 0

    monkeypatch.setattr(gc, "collect", collect)
    monkeypatch.setattr(gc, "get_count", lambda: (1000, 0, 0))
    monkeypatch.setattr(time, "thread_time_ns", lambda: clock[0])
    with IdleCollector() as collector:
        taken.clear()
        for _ in range(300):
            collector.idle(9_000)
    assert taken.count(1) == 1
    assert taken.count(0) == 299


def test_containers_are_collected_however_few_seem_to_be_new(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each deletion of an old container reduces the number of new ones."""
    with IdleCollector() as collector:
        monkeypatch.setattr(gc, "get_count", lambda: (0, 0, 0))
        for _ in range(100):
            collector.idle(10**9)
        assert collector.collections == 4
        for _ in range(2499):
            collector.idle(-1)
        assert collector.collections == 4
        collector.idle(-1)
        assert collector.collections == 5
