"""Handling of Ctrl-C and SIGTERM: they end the current work with a message, or are recorded."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Final, NamedTuple

from outrider.errors import OutriderError

INTERRUPTED = 3
"""Exit status of a command that Ctrl-C or SIGTERM ended before its result was complete."""


_SUSPENDING: Final = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
"""Signals that suspend a process: Ctrl-Z, and a terminal's signals to background processes."""


@contextmanager
def interruptible(left: str) -> Iterator[None]:
    """Handle SIGTERM inside the context like Ctrl-C; raise OutriderError for both, with ``left`` in its text.

    In a thread other than the main one do nothing.
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
    """Record received ``signals`` in the yielded list, in place of their usual handling."""
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
    """Return whether a stop was requested again, at least 1 s after the first request.

    A signal to a process group may arrive twice within a moment; this counts as one request.
    """
    return bool(came) and any(one.at - came[0].at >= _MIN_REPEAT_S for one in came)


_MIN_REPEAT_S = 1.0


@contextmanager
def suspending_signals_ignored() -> Iterator[None]:
    """Ignore the suspending signals: a suspended process could neither relay orders nor request a hold."""
    before = {which: signal.signal(which, signal.SIG_IGN) for which in _SUSPENDING}
    try:
        yield
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)
