"""Handling of Ctrl-C and SIGTERM: they end the current work with a message, or are recorded."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import NamedTuple

from outrider.errors import OutriderError

INTERRUPTED = 3
"""Exit status of a command that Ctrl-C or SIGTERM ended before its result was complete."""


@contextmanager
def interruptible(left: str) -> Iterator[None]:
    """Handle SIGTERM inside the context like Ctrl-C: files are closed, and OutriderError reports ``left``.

    In a thread other than the main one the signal handlers stay unchanged.
    """

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


class ReceivedSignal(NamedTuple):
    """A received signal, and its time (s of the monotonic clock)."""

    which: int
    at: float


@contextmanager
def noted(signals: Sequence[signal.Signals]) -> Iterator[list[ReceivedSignal]]:
    """Record those of ``signals`` that arrive instead of letting them end the process."""
    came: list[ReceivedSignal] = []

    def note(which: int, _frame: FrameType | None) -> None:
        came.append(ReceivedSignal(which, time.monotonic()))

    before = {which: signal.signal(which, note) for which in signals}
    try:
        yield came
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)


def insisted(came: Sequence[ReceivedSignal]) -> bool:
    """Return whether a stop was requested again.

    A signal to a group of processes may arrive twice within a moment; that counts as one request.
    """
    return bool(came) and any(one.at - came[0].at >= _AGAIN for one in came)


_AGAIN = 1.0
