"""Collecting garbage when a control loop has nothing else to do, or seldom, instead of whenever the collector
likes."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Final, Self

_OFTEN: Final = 700
# New containers after which a collection is worth while: Python's own threshold.
_MOST: Final = 100 * _OFTEN
_RESERVE: Final = 3
_SELDOM: Final = (200 * _OFTEN, 10, 10)


class IdleCollector:
    """A context manager, for the whole process. On entry all that exists is put aside (``gc.freeze``) and
    automatic collection ends; ``idle`` collects in the time that is told to be free; on exit all is as it
    was.

    A generation is collected if the free time is 3 times the most that it has taken so far. A loop that is
    never idle long enough collects all the same once there is a lot.
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
        """For ``free`` µs nothing else is to be done; negative if something is overdue."""
        new = gc.get_count()[0]
        if new < _OFTEN:
            return
        generation = 2 if self._runs % 100 == 99 else 1 if self._runs % 10 == 9 else 0
        if free < _RESERVE * self._longest[generation] and new < _MOST:
            return
        # CPU time: that the system once let another process go first says nothing about the next time.
        started = time.thread_time_ns()
        gc.collect(generation)
        took = (time.thread_time_ns() - started) // 1000
        self._longest[generation] = max(self._longest[generation], took)
        self._runs += 1
        self.collections += 1


@contextmanager
def seldom_collected() -> Iterator[None]:
    """For a loop under simulated time, which never waits. All that exists is put aside meanwhile, and what
    comes is looked through once there is a lot of it: the more vehicles live in a process, the longer each
    look takes, and there are hardly any cycles to be found. On exit all is as it was."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(*_SELDOM)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
