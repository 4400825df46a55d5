"""What goes wrong in a scenario becomes events in the order of time, each for the one that it concerns."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from shipped import FIREFLY, LOGS, scenario

from outrider.disturbances import Event, events, strike_autopilot, strike_computer
from outrider.fleet import Fleet

Call = tuple[Any, ...]

FREEZE = {"kind": "freeze", "vehicle": 12, "at_s": 3.0, "for_s": 1.5}
VANISH = {"kind": "vanish", "vehicle": 11, "at_s": 5.0}
LOSS = {"kind": "gps_loss", "vehicle": 11, "at_s": 1.0, "for_s": 2.0}
JUMP = {"kind": "gps_jump", "vehicle": 12, "at_s": 1.0, "for_s": 2.0, "offset": [1.0, 2.0, 3.0]}
MOTOR = {"kind": "motor", "vehicle": 13, "at_s": 0.5, "rotor": 2, "left": 0.25}
CLOCK = {"kind": "clock", "vehicle": 12, "late_ms": 200.0, "drift_ppm": -50.0}
CUT = {"at_s": 2.0, "for_s": 4.0, "members": [11, 12]}


class Calls:
    """Writes down what it is told, whatever that is."""

    def __init__(self) -> None:
        self.made: list[Call] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self.made.append((name, *arguments))


def struck(*faults: dict[str, Any], partitions: tuple[dict[str, Any], ...] = ()) -> list[tuple[int, Call]]:
    """What is called, and when (µs), for autopilots and computers alike."""
    of = scenario("antipodal-8", vehicles=3, faults=faults, partitions=partitions)
    made = []
    for event in events(of):
        calls: Any = Calls()
        strike_autopilot(event, calls)
        strike_computer(event, calls)
        made += [(event.after, call) for call in calls.made]
    return made


@pytest.mark.parametrize(
    ("fault", "calls"),
    [
        (FREEZE, [(3_000_000, ("freeze", 12)), (4_500_000, ("thaw", 12))]),
        (VANISH, [(5_000_000, ("vanish", 11))]),
        (LOSS, [(1_000_000, ("lose_gps",)), (3_000_000, ("regain_gps",))]),
        (JUMP, [(1_000_000, ("shift_gps", (1.0, 2.0, 3.0))), (3_000_000, ("shift_gps", (0.0, 0.0, 0.0)))]),
        (MOTOR, [(500_000, ("fail_rotor", 2, 0.25))]),
        (CLOCK, []),
    ],
)
def test_each_concerns_one_and_ends_when_it_ends(fault: dict[str, Any], calls: list[Any]) -> None:
    assert struck(fault) == calls


def test_a_partition_heals() -> None:
    assert struck(partitions=(CUT,)) == [(2_000_000, ("cut", (11, 12))), (6_000_000, ("heal", (11, 12)))]


@settings(deadline=None)
@given(st.permutations([FREEZE, VANISH, LOSS, JUMP, MOTOR]))
def test_they_come_in_the_order_of_time(faults: list[dict[str, Any]]) -> None:
    of = scenario("antipodal-8", vehicles=3, faults=faults, partitions=(CUT,))
    found = events(of)
    assert [event.after for event in found] == sorted(event.after for event in found)
    begun = {id(event.what) for event in found if not event.over}
    assert begun == {id(event.what) for event in found}
    assert len(found) == 10
    assert isinstance(found[0], Event)


def test_a_clock_that_is_off_is_off_from_the_start_and_the_others_within_bounds() -> None:
    of = scenario("antipodal-8", vehicles=3, faults=[CLOCK], clocks={"offset_ms": 2.0, "drift_ppm": 30.0})
    fleet = Fleet(of, FIREFLY, 5, LOGS)
    clocks = [fleet.clock(k, 1_000_000) for k in range(3)]
    assert (clocks[1].offset, clocks[1].drift_ppm, clocks[1].since) == (-200_000, -50.0, 1_000_000)
    for clock in (clocks[0], clocks[2]):
        assert 0 < abs(clock.offset) <= 2_000
        assert 0.0 < abs(clock.drift_ppm) <= 30.0
    assert clocks == [Fleet(of, FIREFLY, 5, LOGS).clock(k, 1_000_000) for k in range(3)]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"faults": [{**VANISH, "vehicle": 14}]}, "11 to 13 are allowed"),
        ({"partitions": [{**CUT, "members": [11, 99]}]}, "99 is none of the fleet"),
        ({"faults": [{**MOTOR, "left": 1.5}]}, "less than or equal to 1"),
        ({"faults": [{**VANISH, "for_s": 1.0}]}, "not permitted"),
        ({"faults": [{"kind": "melt", "vehicle": 11}]}, "melt"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        scenario("antipodal-8", vehicles=3, **changes)
