"""Records of a log on one time line that never goes back.

Clocks of recording computers are set, logs are joined, and single stamps are wrong. A stamp that goes back by
more than a second, or ahead by more than a day, begins a new stretch that follows the last one, if the next
record confirms it. Otherwise it is a single wrong stamp, and is replaced by the previous one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from mavlink_bridge.tlog.log import Record

IDLE = 5_000_000
"""µs of silence that are stepped through; a longer silence is skipped."""
_BACK = 1_000_000
_AHEAD = 86_400_000_000
_LONE = 60_000_000
"""µs; a stamp that is further ahead must be confirmed by the next."""


def on_one_line(records: Iterable[Record]) -> Iterator[Record]:
    """Yield the same records with times (µs, multiples of 4) that never decrease."""
    shift, last = 0, None
    following = iter(records)
    record = next(following, None)
    while record is not None:
        after = next(following, None)
        time = record.time - record.time % 4 + shift
        if last is not None and not last - _BACK <= time <= last + _LONE:
            confirmed = after is None or abs(after.time - record.time) <= _LONE
            if not confirmed:
                time = last
            elif time < last or time > last + _AHEAD:
                shift += last - time
                time = last
        last = time if last is None else max(time, last)
        yield record._replace(time=last)
        record = after
