"""Times in which the autopilots alone decide on the vehicles' heights: in take-off and landing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from outrider.certify.evidence import Log
from outrider.certify.histories import History

_EVER = 1 << 62


class Span(NamedTuple):
    """Time from ``begin`` to ``end`` (µs)."""

    begin: int
    end: int


def heights(histories: Sequence[History], logs: Sequence[Log]) -> list[tuple[Span, ...]]:
    """Return, for each history, the times in which the vehicle's autopilot takes it off or lands it.

    A climb ends with the first plan in space after the order, a landing with the return after a farewell.
    """
    by_owner = {log.owner: log for log in logs}
    return [
        tuple(_spans(history, by_owner[history.system])) if history.system in by_owner else ()
        for history in histories
    ]


def _spans(history: History, log: Log) -> Iterable[Span]:
    for order in log.orders:
        if order.climbs:
            ends = (s.plan.epoch for s in history.steps if s.plan.epoch > order.time and not s.plan.column)
        else:
            ends = (
                leave.back for leave in history.leaves if leave.back is not None and leave.back > order.time
            )
        yield Span(order.time, min(ends, default=_EVER))


def within(spans: Iterable[Span], begin: int, end: int) -> bool:
    """Return whether one of ``spans`` has a time between ``begin`` and ``end`` (µs)."""
    return any(span.begin < end and begin < span.end for span in spans)
