"""Error of the host's system clock, as its kernel bounds it.

A daemon that disciplines the clock (NTP, PTP, gpsd) tells the kernel the largest error; from then on the
kernel lets it grow by 500 ppm until the next correction (``adjtimex(2)``, ``maxerror``). A clock that nobody
disciplines has the status STA_UNSYNC.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from typing import NamedTuple

_STA_UNSYNC = 0x0040
_TIME_ERROR = 5
_SPARE_BYTES = 44
"""Unused bytes at the end of ``struct timex``: eleven 32-bit integers."""


class SystemTimeReading(NamedTuple):
    """UTC is ahead of the own clock by ``ahead`` ± ``bound``, µs."""

    ahead: int
    bound: int


SystemClock = Callable[[int], SystemTimeReading | None]
"""Function of the own time (µs) that reads the system clock; None while nobody disciplines it."""


class KernelStatus(NamedTuple):
    """Return value of ``adjtimex``, and status and largest error (µs) of the clock."""

    state: int
    status: int
    max_error: int

    @property
    def disciplined(self) -> bool:
        """Whether the clock is disciplined."""
        return self.state >= 0 and self.state != _TIME_ERROR and not self.status & _STA_UNSYNC


class _Timex(ctypes.Structure):
    """``struct timex`` of Linux with a 64-bit or 32-bit ``long``."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("constant", ctypes.c_long),
        ("precision", ctypes.c_long),
        ("tolerance", ctypes.c_long),
        ("time_s", ctypes.c_long),
        ("time_us", ctypes.c_long),
        ("tick", ctypes.c_long),
        ("ppsfreq", ctypes.c_long),
        ("jitter", ctypes.c_long),
        ("shift", ctypes.c_int),
        ("stabil", ctypes.c_long),
        ("jitcnt", ctypes.c_long),
        ("calcnt", ctypes.c_long),
        ("errcnt", ctypes.c_long),
        ("stbcnt", ctypes.c_long),
        ("tai", ctypes.c_int),
        ("spare", ctypes.c_byte * _SPARE_BYTES),
    )


def kernel_status() -> KernelStatus | None:
    """Return what the kernel says of its clock; None on a system without ``adjtimex``.

    Reading needs no privilege.
    """
    try:
        call = ctypes.CDLL(None).adjtimex
    except (AttributeError, OSError):
        return None
    timex = _Timex()
    state = int(call(ctypes.byref(timex)))
    return KernelStatus(state, int(timex.status), int(timex.maxerror))


class KernelClock:
    """System clock of this host relative to a ``WallClock`` with ``offset_ns``, a ``SystemClock``.

    ``status`` reads the kernel's status, ``utc`` and ``monotonic`` the clocks (ns).
    """

    def __init__(
        self,
        offset_ns: int,
        status: Callable[[], KernelStatus | None] = kernel_status,
        utc: Callable[[], int] = time.time_ns,
        monotonic: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._offset = offset_ns
        self._status, self._utc, self._monotonic = status, utc, monotonic

    def __call__(self, now: int) -> SystemTimeReading | None:
        """Read the clock; None while nobody disciplines it.

        ``now`` is not used: both clocks are read here. UTC is read between two readings of the monotonic
        clock, so a process that is interrupted in between has a larger bound, and never a wrong one.
        """
        status = self._status()
        if status is None or not status.disciplined:
            return None
        before = self._monotonic()
        utc = self._utc()
        after = self._monotonic()
        ahead = (utc - (before + after) // 2 - self._offset) // 1000
        # 2 µs for the three divisions that round down.
        return SystemTimeReading(ahead, status.max_error + (after - before) // 2000 + 2)
