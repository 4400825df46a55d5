"""What the kernel says of its clock: a bound that holds, and nothing where nobody disciplines it."""

from __future__ import annotations

import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.clocks.system_clock import KernelClock, KernelStatus, kernel_status

SECOND_NS = 1_000_000_000
UNSYNC = 0x0040
GOOD = KernelStatus(0, 0x2001, 1_500)


class Host:
    """A host whose UTC is ``off`` ns beside its monotonic clock, and whose readings take ``pauses`` ns."""

    def __init__(self, off: int, pauses: tuple[int, int]) -> None:
        self.now, self.off, self.pauses = 5 * SECOND_NS, off, list(pauses)

    def monotonic(self) -> int:
        return self.now

    def utc(self) -> int:
        self.now += self.pauses[0]
        shown = self.now + self.off
        self.now += self.pauses[1]
        return shown


@given(
    st.integers(-(10**18), 10**18),
    st.integers(-(10**18), 10**18),
    st.tuples(st.integers(0, 10**9), st.integers(0, 10**9)),
)
def test_the_bound_holds_however_long_a_reading_is_interrupted(
    off: int, offset: int, pauses: tuple[int, int]
) -> None:
    host = Host(off, pauses)
    reading = KernelClock(offset, lambda: GOOD, host.utc, host.monotonic)(0)
    assert reading is not None
    truth_ns = off - offset
    assert abs(1000 * reading.ahead - truth_ns) <= 1000 * (reading.bound - GOOD.max_error)
    assert reading.bound <= GOOD.max_error + sum(pauses) // 2000 + 2


@pytest.mark.parametrize(
    "status",
    [None, KernelStatus(5, 0, 10), KernelStatus(-1, 0, 10), KernelStatus(0, UNSYNC, 10)],
    ids=["no adjtimex", "TIME_ERROR", "refused", "STA_UNSYNC"],
)
def test_a_clock_that_nobody_disciplines_says_nothing(status: KernelStatus | None) -> None:
    assert KernelClock(0, lambda: status)(0) is None


@pytest.mark.skipif(sys.platform != "linux", reason="adjtimex is Linux's")
def test_the_kernels_structure_is_read_where_it_is() -> None:
    """The kernel's bound is at most 16 s, and the status agrees with the state; other fields would not."""
    status = kernel_status()
    assert status is not None
    assert 0 <= status.state <= 5
    assert 0 <= status.max_error <= 16_000_000
    assert (status.state == 5) >= bool(status.status & UNSYNC)


@pytest.mark.skipif(sys.platform != "linux", reason="adjtimex is Linux's")
def test_of_this_host_it_reads_utc() -> None:
    clock = KernelClock(0, lambda: GOOD)
    before = time.time_ns() - time.monotonic_ns()
    reading = clock(0)
    after = time.time_ns() - time.monotonic_ns()
    assert reading is not None
    low, high = sorted((before, after))
    assert low // 1000 - reading.bound <= reading.ahead <= high // 1000 + reading.bound
