"""Faults and partitions of a scenario as events in time, relative to the goal event."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple, Protocol

from outrider.scenarios.faults import (
    ClockStep,
    Freeze,
    FromStart,
    GpsJump,
    GpsLoss,
    MotorFailure,
    Restart,
    Sudden,
    UtcStep,
    Vanish,
)
from outrider.scenarios.links import PartitionPart
from outrider.scenarios.scenario import Scenario
from sitl.node import Autopilot


class Event(NamedTuple):
    """Beginning of ``what``, or its end if ``over``, ``after`` µs after the goal event."""

    after: int
    what: Sudden | PartitionPart
    over: bool


class Computers(Protocol):
    """Interface to the companions' computers and radios, for faults."""

    def freeze(self, system: int) -> None:
        """Suspend the companion of ``system``."""
        ...

    def thaw(self, system: int) -> None:
        """Resume the companion of ``system``."""
        ...

    def vanish(self, system: int) -> None:
        """Remove the companion of ``system`` for good."""
        ...

    def end(self, system: int) -> None:
        """End the companion of ``system`` until ``restart``."""
        ...

    def restart(self, system: int) -> None:
        """Start another companion of ``system``."""
        ...

    def step_clock(self, system: int, by: int) -> None:
        """Let the system clock of the companion of ``system`` step by ``by`` (µs)."""
        ...

    def cut(self, systems: tuple[int, ...]) -> None:
        """Block the swarm link between these systems and the others."""
        ...

    def heal(self, systems: tuple[int, ...]) -> None:
        """End the block between these systems and the others."""
        ...


def events(scenario: Scenario) -> list[Event]:
    """Return all events of a scenario, sorted by time; of simultaneous events the ends come first."""
    found = []
    sudden = [fault for fault in scenario.faults if not isinstance(fault, FromStart)]
    for what in (*sudden, *scenario.partitions):
        begin = round(1e6 * what.at_s)
        found.append(Event(begin, what, False))
        lasts = getattr(what, "for_s", None)
        if lasts is not None:
            found.append(Event(max(round(1e6 * (what.at_s + lasts)), begin + 1), what, True))
    return sorted(found, key=lambda event: (event.after, not event.over))


def strike_autopilot(event: Event, autopilot: Autopilot) -> None:
    """Apply an event to ``autopilot``, that of the event's vehicle; events of companions have no effect."""
    match event.what:
        case GpsLoss():
            if event.over:
                autopilot.regain_gps()
            else:
                autopilot.lose_gps()
        case GpsJump(offset=offset):
            autopilot.shift_gps((0.0, 0.0, 0.0) if event.over else offset)
        case MotorFailure(rotor=rotor, left=left):
            # ``left`` is the share of thrust; ``fail_rotor`` takes the share of speed; thrust ~ speed².
            autopilot.fail_rotor(rotor, sqrt(left))
        case UtcStep(step_ms=step):
            autopilot.shift_utc(round(1000.0 * step))
        case _:
            pass


def strike_computer(event: Event, computers: Computers) -> None:
    """Apply an event to a companion's computer or radio; events of autopilots have no effect."""
    match event.what:
        case Freeze(vehicle=system):
            if event.over:
                computers.thaw(system)
            else:
                computers.freeze(system)
        case Vanish(vehicle=system):
            computers.vanish(system)
        case Restart(vehicle=system):
            if event.over:
                computers.restart(system)
            else:
                computers.end(system)
        case ClockStep(vehicle=system, step_ms=step):
            computers.step_clock(system, round(1000.0 * step))
        case PartitionPart(members=systems):
            if event.over:
                computers.heal(systems)
            else:
                computers.cut(systems)
        case _:
            pass
