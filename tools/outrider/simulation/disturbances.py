"""The faults and partitions of a scenario as events in time, relative to the goal event."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple, Protocol

from outrider.scenarios.faults import (
    ClockFault,
    Freeze,
    GpsJump,
    GpsLoss,
    MotorFailure,
    Sudden,
    Vanish,
)
from outrider.scenarios.links import PartitionPart
from outrider.scenarios.scenario import Scenario
from sitl.node import Autopilot


class Event(NamedTuple):
    """``what`` begins, or ends if ``over``, ``after`` µs after the goal event."""

    after: int
    what: Sudden | PartitionPart
    over: bool


class Computers(Protocol):
    """Whoever runs the companions: what can happen to a computer and its radio."""

    def freeze(self, system: int) -> None:
        """It hangs."""
        ...

    def thaw(self, system: int) -> None:
        """It goes on."""
        ...

    def vanish(self, system: int) -> None:
        """It is gone."""
        ...

    def cut(self, systems: tuple[int, ...]) -> None:
        """Nothing passes between these and the others on the swarm link."""
        ...

    def heal(self, systems: tuple[int, ...]) -> None:
        """It passes again."""
        ...


def events(scenario: Scenario) -> list[Event]:
    """All of a scenario, in the order of time; what ends at an instant goes before what begins then."""
    found = []
    # A clock that is off is off from the start: it is no event.
    sudden = [fault for fault in scenario.faults if not isinstance(fault, ClockFault)]
    for what in (*sudden, *scenario.partitions):
        begin = round(1e6 * what.at_s)
        found.append(Event(begin, what, False))
        lasts = getattr(what, "for_s", None)
        if lasts is not None:
            found.append(Event(max(round(1e6 * (what.at_s + lasts)), begin + 1), what, True))
    return sorted(found, key=lambda event: (event.after, not event.over))


def strike_autopilot(event: Event, autopilot: Autopilot) -> None:
    """Let an event happen to its vehicle's autopilot; one that concerns the companion does nothing here."""
    match event.what:
        case GpsLoss():
            if event.over:
                autopilot.regain_gps()
            else:
                autopilot.lose_gps()
        case GpsJump(offset=offset):
            autopilot.shift_gps((0.0, 0.0, 0.0) if event.over else offset)
        case MotorFailure(rotor=rotor, left=left):
            # Thrust goes with the square of the speed, which is what fails.
            autopilot.fail_rotor(rotor, sqrt(left))
        case _:
            pass


def strike_computer(event: Event, computers: Computers) -> None:
    """Let an event happen to a companion's computer or radio; one of an autopilot does nothing here."""
    match event.what:
        case Freeze(vehicle=system):
            if event.over:
                computers.thaw(system)
            else:
                computers.freeze(system)
        case Vanish(vehicle=system):
            computers.vanish(system)
        case PartitionPart(members=systems):
            if event.over:
                computers.heal(systems)
            else:
                computers.cut(systems)
        case _:
            pass
