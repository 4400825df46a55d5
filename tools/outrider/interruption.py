"""Ctrl-C and SIGTERM end what is being done with a sentence instead of silence, or are noted."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import NamedTuple

from outrider.errors import OutriderError


@contextmanager
def interruptible(left: str) -> Iterator[None]:
    """Inside it SIGTERM is as good as Ctrl-C: files are closed, and OutriderError says what is ``left``. In
    another thread than the main one signals stay as they are."""

    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    except KeyboardInterrupt:
        raise OutriderError(f"stopped; {left}") from None
    finally:
        signal.signal(signal.SIGTERM, before)


class Came(NamedTuple):
    """A signal, and when (s of the monotonic clock)."""

    which: int
    at: float


@contextmanager
def noted(signals: Sequence[signal.Signals]) -> Iterator[list[Came]]:
    """Those of ``signals`` that have come, and would otherwise have ended the process."""
    came: list[Came] = []

    def note(which: int, _frame: FrameType | None) -> None:
        came.append(Came(which, time.monotonic()))

    before = {which: signal.signal(which, note) for which in signals}
    try:
        yield came
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)


def insisted(came: Sequence[Came]) -> bool:
    """Whether somebody asked again. Who signals a group of processes is heard twice in a moment: that is
    one."""
    return bool(came) and any(one.at - came[0].at >= _AGAIN for one in came)


_AGAIN = 1.0
