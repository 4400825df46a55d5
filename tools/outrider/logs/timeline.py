"""Records of a log on one time line that never goes back.

Clocks of recording computers are set, logs are joined, and single stamps are wrong. A stamp more than 1 s
before or 60 s after the previous one must be confirmed: the next record is within 60 s of it, or there is
none. Otherwise it is a single wrong stamp, and is replaced by the previous one. A confirmed stamp that is
earlier, or more than a day later, begins a new stretch that follows the last one without a gap.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from mavlink_bridge.tlog.log import Record

IDLE = 5_000_000
"""Longest silence (µs) that is waited for; of a longer silence the rest is skipped."""
_MAX_BACK_US = 1_000_000
_MAX_AHEAD_US = 86_400_000_000
_MAX_UNCONFIRMED_US = 60_000_000
"""A stamp further ahead (µs) must be confirmed: the next is at most as far from it."""


def on_one_line(records: Iterable[Record]) -> Iterator[Record]:
    """Yield the same records with times (µs, multiples of 4) that never decrease."""
    shift, last = 0, None
    following = iter(records)
    record = next(following, None)
    while record is not None:
        after = next(following, None)
        time = record.time - record.time % 4 + shift
        if last is not None and not last - _MAX_BACK_US <= time <= last + _MAX_UNCONFIRMED_US:
            confirmed = after is None or abs(after.time - record.time) <= _MAX_UNCONFIRMED_US
            if not confirmed:
                time = last
            elif time < last or time > last + _MAX_AHEAD_US:
                shift += last - time
                time = last
        last = time if last is None else max(time, last)
        yield record._replace(time=last)
        record = after
