"""Garbage collection during the idle time of a control loop, or seldom, instead of at arbitrary moments."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Final, Self

_MIN_NEW: Final = 700
"""Number of new containers below which nothing is collected: the default threshold of CPython 3.11."""
_MAX_NEW: Final = 100 * _MIN_NEW
"""Number of new containers above which a collection takes place without enough idle time."""
_TIME_MARGIN: Final = 3
_SELDOM_THRESHOLDS: Final = (200 * _MIN_NEW, 10, 10)


class IdleCollector:
    """Context manager that restricts the garbage collection of the whole process to idle time.

    On entry all existing objects are frozen (``gc.freeze``) and automatic collection is switched off.
    ``idle`` collects within the free time that it receives. On exit the previous state is restored.

    Every tenth collection is of generation 1, every hundredth of generation 2, the others of generation 0. A
    collection requires free time of at least 3 times the longest one of its generation so far. A loop that is
    never idle long enough collects nevertheless once 70 000 new containers exist.
    """

    def __init__(self) -> None:
        self.collections = 0
        # µs of CPU time by generation; initial estimates, which only grow.
        self._longest = [200, 500, 2000]
        self._runs = 0
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
        new = gc.get_count()[0]
        if new < _MIN_NEW:
            return
        generation = 2 if self._runs % 100 == 99 else 1 if self._runs % 10 == 9 else 0
        if free < _TIME_MARGIN * self._longest[generation] and new < _MAX_NEW:
            return
        # CPU time: a single preemption by another process does not predict the next collection.
        started = time.thread_time_ns()
        gc.collect(generation)
        took = (time.thread_time_ns() - started) // 1000
        self._longest[generation] = max(self._longest[generation], took)
        self._runs += 1
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
