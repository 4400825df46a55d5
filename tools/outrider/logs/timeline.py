"""Records of a log on one time line that never goes back.

Clocks of recording computers are set, logs are joined, and single stamps are wrong. A stamp more than 1 s
before or more than 60 s after the previous time must be confirmed: the next record's stamp is within 60 s of
it, or there is no next record. A stamp that is not confirmed is a single wrong stamp. It is replaced by the
previous time, and so is a stamp that is earlier by 1 s or less. A confirmed stamp that is earlier, or more
than a day later, begins a new stretch that follows the last one without a gap.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from mavlink_bridge.tlog.log import Record

IDLE = 5_000_000
"""Longest silence (µs) that replays keep; they shorten or skip longer ones."""
_MAX_BACK_US = 1_000_000
_MAX_AHEAD_US = 86_400_000_000
_MAX_UNCONFIRMED_US = 60_000_000
"""Largest advance (µs) of a stamp that needs no confirmation; largest distance of a confirming next stamp."""


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
