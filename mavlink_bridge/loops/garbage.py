"""Garbage collection during the idle time of a control loop, or seldom, instead of at arbitrary moments."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Final, Self

_OFTEN: Final = 700
# Number of new containers that justifies a collection: Python's own threshold.
_MOST: Final = 100 * _OFTEN
_RESERVE: Final = 3
_SELDOM: Final = (200 * _OFTEN, 10, 10)


class IdleCollector:
    """Context manager that restricts the garbage collection of the whole process to idle time.

    On entry all existing objects are frozen (``gc.freeze``) and automatic collection is switched off.
    ``idle`` collects within the free time that it receives. On exit the previous state is restored.

    A generation is collected if the free time is at least 3 times the longest collection of that generation
    so far. A loop that is never idle long enough collects nevertheless once 70 000 new containers exist.
    """

    def __init__(self) -> None:
        self.collections = 0
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
        """Collect if it fits into ``free`` µs of idle time; a negative value means that a step is overdue."""
        new = gc.get_count()[0]
        if new < _OFTEN:
            return
        generation = 2 if self._runs % 100 == 99 else 1 if self._runs % 10 == 9 else 0
        if free < _RESERVE * self._longest[generation] and new < _MOST:
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
    """Collect seldom while a loop under simulated time runs, because such a loop is never idle.

    Existing objects are frozen meanwhile, and new ones are examined once there are many: the more vehicles a
    process holds, the longer each collection takes, and there are hardly any cycles to find. On exit the
    previous state is restored.
    """
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(*_SELDOM)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
