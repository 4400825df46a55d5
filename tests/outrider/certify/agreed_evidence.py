"""Evidence of two vehicles that agree in each epoch, and changes of it."""

from __future__ import annotations

from collections.abc import Callable

from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import Integers, WirePlan
from outrider.certify.evidence import Evidence, LoggedStatement
from outrider.certify.verdict import Verdict
from tests.outrider.certify.evidence import (
    BEGAN,
    EPOCH,
    evidence,
    on,
    restated,
    standing,
    turned,
)

A, B = standing((0.0, 0.0, 5.0)), standing((3.0, 0.0, 5.0))
"""3 m apart, of which 1.2 m are required: each may come 0.9 m nearer."""
EPOCHS = 6
Change = Callable[[Statement], Statement | None]


def at(number: int) -> int:
    """The epoch with this ``number`` (µs)."""
    return BEGAN + number * EPOCH


def aside(plan: WirePlan, count: int = EPOCHS) -> list[WirePlan]:
    """``plan``, and plans made after it that go north and back, in turn."""
    plans = [plan]
    for number in range(1, count):
        way = 300 if number % 2 else -300
        plans.append(turned(on(plans[-1]), [(0, way, 0), (0, -way, 0)]))
    return plans


def nearer(plan: WirePlan, metres: float, epochs: int = 1) -> WirePlan:
    """A plan made ``epochs`` after ``plan``, which rests: ``metres`` towards east."""
    most = round(1000 * metres)
    accelerations: list[Integers] = [(most, 0, 0)] * 5 + [(-most, 0, 0)] * 5
    return turned(on(plan, epochs), accelerations)


def swarm() -> Evidence:
    """Two that make a plan in each epoch."""
    return evidence({11: aside(A), 12: aside(B)})


def found(verdict: Verdict) -> list[tuple[str, tuple[int, ...]]]:
    return [(finding.what, finding.who) for finding in verdict.findings]


def changed(whole: Evidence, system: int, epoch: int, change: Change) -> Evidence:
    """What ``system`` states in ``epoch`` is as ``change`` has it, in all logs."""

    def of(one: LoggedStatement) -> Statement | None:
        if (one.sender, one.statement.epoch) != (system, epoch):
            return one.statement
        return change(one.statement)

    return restated(whole, of)


def with_entry(statement: Statement, change: Callable[[Entry], Entry]) -> Statement:
    return statement._replace(entries=tuple(change(entry) for entry in statement.entries))


def unheard(whole: Evidence, owner: int, sender: int, since: int) -> Evidence:
    """``owner`` has heard no statement of ``sender`` from the epoch ``since`` on."""

    def of(one: LoggedStatement) -> Statement | None:
        lost = (one.owner, one.sender) == (owner, sender) and one.statement.epoch >= since
        return None if lost else one.statement

    return restated(whole, of)
