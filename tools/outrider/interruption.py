"""Ctrl-C and SIGTERM end what is being done with a sentence instead of silence, or are noted."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

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


@contextmanager
def noted(signals: Sequence[signal.Signals]) -> Iterator[list[int]]:
    """Those of ``signals`` that have come, and would otherwise have ended the process."""
    came: list[int] = []

    def note(which: int, _frame: FrameType | None) -> None:
        came.append(which)

    before = {which: signal.signal(which, note) for which in signals}
    try:
        yield came
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)
