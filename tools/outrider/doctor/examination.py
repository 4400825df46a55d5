"""Complete examination without I/O: frames in, a verdict out at any time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import Final

from mavlink_bridge.messages import Source
from outrider.doctor import (
    agility,
    cameras,
    clocks,
    health,
    identity,
    place,
    positioning,
    presence,
    settings,
    wire,
)
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity, Verdict
from outrider.doctor.hearing import Hearing
from outrider.doctor.sender_record import SenderRecord
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
    cameras.cameras,
    presence.company,
    wire.wire,
)
_WORST_FIRST: Final = (Severity.BLOCKING, Severity.WARNING, Severity.NOTE, Severity.OK)


class Examination:
    """Examination of the autopilot ``system``.

    None selects the lowest id, in a log the vehicle with the most messages; ``Hearing.vehicle`` has the
    exceptions. ``log``: the frames are those of a log; ``me``: sender id of the doctor.
    """

    def __init__(self, system: int | None = None, *, log: bool = False, me: Source | None = None) -> None:
        self.hearing = Hearing()
        self.system, self.log, self.me = system, log, me
        self.baud: int | None = None
        """Baud rate of the serial port, None for other links."""
        self.asked: dict[int, int] = {}
        """Number of requests by the doctor for each message id."""

    @property
    def vehicle(self) -> SenderRecord | None:
        """Examined vehicle, None before it is received."""
        return self.hearing.vehicle(self.system, lowest=not self.log)

    def verdict(self) -> Verdict:
        """Return the verdict on everything received so far."""
        vehicle = self.vehicle
        if vehicle is None:
            return Verdict((presence.nobody(self.hearing, self.system, self.log),))
        vehicle.vehicle.tick(self.hearing.end)
        case = Case(self.hearing, vehicle, self.log, self.me, self.baud)
        found = chain(*(check(case) for check in _CHECKS), streams(case, self.asked))
        return Verdict(tuple(sorted(found, key=lambda finding: _WORST_FIRST.index(finding.severity))))
