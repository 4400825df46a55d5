"""The whole examination, without I/O: frames in, a verdict out, at any time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import Final

from mavlink_bridge.messages import Source
from outrider.doctor import agility, clocks, health, identity, place, positioning, presence, settings, wire
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity, Verdict
from outrider.doctor.hearing import Hearing
from outrider.doctor.speaker import Speaker
from outrider.doctor.streams import streams

_CHECKS: Final[tuple[Callable[[Case], Iterator[Finding]], ...]] = (
    identity.firmware,
    identity.dialect,
    identity.state,
    health.checks,
    positioning.estimator,
    positioning.gps,
    health.battery,
    place.origin,
    place.home,
    place.agreement,
    clocks.clock,
    settings.settings,
    agility.agility,
    presence.company,
    wire.wire,
)
_WORST_FIRST: Final = (Severity.BLOCKING, Severity.WARNING, Severity.NOTE, Severity.OK)


class Examination:
    """Of the autopilot ``system`` (None: the lowest, in a log the one that says most). ``log``: it is a
    recording; ``me``: as whom the doctor speaks."""

    def __init__(self, system: int | None = None, *, log: bool = False, me: Source | None = None) -> None:
        self.hearing = Hearing()
        self.system, self.log, self.me = system, log, me
        self.baud: int | None = None
        """Of the serial port that it is behind."""
        self.asked: dict[int, int] = {}
        """How often the doctor asked for a message, by its id."""

    @property
    def vehicle(self) -> Speaker | None:
        """Who is examined, as far as it has shown itself."""
        return self.hearing.vehicle(self.system, lowest=not self.log)

    def verdict(self) -> Verdict:
        """By what was heard until now."""
        vehicle = self.vehicle
        if vehicle is None:
            return Verdict((presence.nobody(self.hearing, self.system, self.log),))
        vehicle.vehicle.tick(self.hearing.end)
        case = Case(self.hearing, vehicle, self.log, self.me, self.baud)
        found = chain(*(check(case) for check in _CHECKS), streams(case, self.asked))
        return Verdict(tuple(sorted(found, key=lambda finding: _WORST_FIRST.index(finding.severity))))
