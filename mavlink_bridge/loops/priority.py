"""Requests to the system for punctual loops: real-time priority, locked memory, precise timers."""

from __future__ import annotations

import ctypes
import os
import sys
from typing import Final, NamedTuple

LEVEL: Final = 20
"""Real-time priority (1…99): above all normal threads, below the kernel's device threads (50)."""

_LOCK_CURRENT, _LOCK_FUTURE, _LOCK_ON_FAULT = 1, 2, 4
_SET_TIMER_SLACK: Final = 29
_SLACK_NS: Final = 1000
_HINT: Final = (
    "allow it with a limit (ulimit -r {level}, or rtprio in /etc/security/limits.conf), with the capability "
    "CAP_SYS_NICE (setcap cap_sys_nice+ep on the Python executable), or in a container with "
    "docker run --cap-add SYS_NICE --ulimit rtprio={level}"
)


class Priority(NamedTuple):
    """Privileges that the system granted.

    ``told`` reports them in words, with the remedy if a request was refused.
    """

    realtime: bool
    locked: bool
    told: str


def ask_for_priority(level: int = LEVEL) -> Priority:
    """Request SCHED_FIFO at ``level``, locked pages and 1 µs of timer slack, for this and later threads.

    A refusal raises nothing; the result reports it. Call this before any other thread is started: a thread of
    lower priority that holds the interpreter lock would hold up all others.
    """
    sharpen_timers()
    refusal = _fifo(level)
    locked = refusal is None and _lock_memory()
    if refusal is not None:
        return Priority(False, False, f"no real-time priority: {refusal}")
    kept = "memory is locked" if locked else "memory is not locked (ulimit -l unlimited would allow it)"
    return Priority(True, locked, f"real-time priority {level} (SCHED_FIFO), {kept}")


def sharpen_timers() -> bool:
    """Reduce the timer slack of this thread to 1 µs and return whether that succeeded.

    By default Linux may extend every sleep of a normal thread by up to 50 µs.
    """
    if sys.platform != "linux":
        return False
    libc = ctypes.CDLL(None, use_errno=True)
    return bool(libc.prctl(_SET_TIMER_SLACK, ctypes.c_ulong(_SLACK_NS), 0, 0, 0) == 0)


def _fifo(level: int) -> str | None:
    """Request SCHED_FIFO; return None, or the reason of the refusal."""
    if sys.platform != "linux":
        return "it needs Linux"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(level))
    except PermissionError:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
        return f"the system allows this process at most {limit}; " + _HINT.format(level=level)
    except OSError as error:
        return f"level {level}: {error.strerror}"
    return None


def _lock_memory() -> bool:
    """Lock pages as they come into use if the limit can be lifted; return whether they are locked.

    Under a limit, allocations would fail in flight.
    """
    if sys.platform != "linux":
        return False
    import resource

    everything = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
    try:
        resource.setrlimit(resource.RLIMIT_MEMLOCK, everything)
    except (OSError, ValueError):
        return False
    flags = _LOCK_CURRENT | _LOCK_FUTURE | _LOCK_ON_FAULT
    return bool(ctypes.CDLL(None, use_errno=True).mlockall(flags) == 0)
