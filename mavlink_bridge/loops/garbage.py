"""Garbage collection during the idle time of a control loop, or seldom, instead of at arbitrary moments."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Final, Self

_MIN_NEW: Final = 700
"""Number of new containers from which they are collected: the default threshold of CPython 3.11."""
_CALLS: Final = 25
"""Number of calls after which new containers are collected, however few they seem."""
_MOST: Final = 100.0
"""Multiple of ``_MIN_NEW`` or ``_CALLS`` from which a collection takes place without enough idle time."""
_TIME_MARGIN: Final = 3
_SELDOM_THRESHOLDS: Final = (200 * _MIN_NEW, 10, 10)


class IdleCollector:
    """Context manager that restricts the garbage collection of the whole process to idle time.

    On entry all existing objects are frozen (``gc.freeze``) and automatic collection is switched off.
    ``idle`` collects within the free time that it receives. On exit the previous state is restored.

    A collection follows 700 new containers or 25 calls. The calls count because a container that is deleted
    reduces the number of new ones, however old it is: where caches are full, that number hardly grows.

    Every tenth collection is due in generation 1, every hundredth in generation 2, the others in 0. A
    generation requires free time of at least 3 times what it may take, by the longest ones so far and by what
    has come since. Without that time it remains due, and a younger one is collected in its place; otherwise
    even generation 0 would grow until it takes too long. A loop that is never idle long enough collects
    generation 0 nevertheless after 70 000 new containers or 2500 calls.
    """

    def __init__(self) -> None:
        self.collections = 0
        # µs of CPU time, initial estimates which only grow: of generation 0 per 700 containers or 25 calls.
        self._longest = [200.0, 500.0, 2000.0]
        self._runs = self._calls = self._aged = 0
        self._enabled = False

    def __enter__(self) -> Self:
        self._enabled = gc.isenabled()
        gc.collect()
        gc.freeze()
        gc.disable()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        gc.unfreeze()
        if self._enabled:
            gc.enable()

    def idle(self, free: int) -> None:
        """Collect if ``free`` (µs of idle time, negative if a step is overdue) suffices."""
        self._calls += 1
        size = max(gc.get_count()[0] / _MIN_NEW, self._calls / _CALLS)
        if size < 1.0:
            return
        due = 2 if self._runs % 100 == 99 else 1 if self._runs % 10 == 9 else 0
        youngest, middle, oldest = self._longest
        expected = (size * youngest, middle, oldest + self._aged * middle)
        fits = [generation for generation in range(due + 1) if free >= _TIME_MARGIN * expected[generation]]
        if not fits and size < _MOST:
            return
        generation = max(fits, default=0)
        # CPU time: a single preemption by another process does not predict the next collection.
        started = time.thread_time_ns()
        gc.collect(generation)
        took = 1e-3 * (time.thread_time_ns() - started) / (1.0 if generation else size)
        self._longest[generation] = max(self._longest[generation], took)
        self._aged = 0 if generation == 2 else self._aged + generation
        self._calls = 0
        self._runs += generation == due
        self.collections += 1


@contextmanager
def seldom_collected() -> Iterator[None]:
    """Collect seldom within the context, for a loop under simulated time, which is never idle.

    Existing objects are frozen, and the threshold of new containers is 140 000: a collection takes longer the
    more vehicles a process holds, and there are hardly any cycles to find. On exit the thresholds are
    restored and all objects are unfrozen.
    """
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(*_SELDOM_THRESHOLDS)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
