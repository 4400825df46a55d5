"""What goes wrong in a scenario becomes events in the order of time, each for the one that it concerns."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from outrider.simulation.disturbances import Event, events, strike_autopilot, strike_computer
from outrider.simulation.fleet import Fleet
from tests.outrider.shipped import FIREFLY, LOGS, scenario

Call = tuple[Any, ...]

FREEZE = {"kind": "freeze", "vehicle": 12, "at_s": 3.0, "for_s": 1.5}
VANISH = {"kind": "vanish", "vehicle": 11, "at_s": 5.0}
RESTART = {"kind": "restart", "vehicle": 13, "at_s": 2.0, "for_s": 1.5}
LOSS = {"kind": "gps_loss", "vehicle": 11, "at_s": 1.0, "for_s": 2.0}
JUMP = {"kind": "gps_jump", "vehicle": 12, "at_s": 1.0, "for_s": 2.0, "offset": [1.0, 2.0, 3.0]}
MOTOR = {"kind": "motor", "vehicle": 13, "at_s": 0.5, "rotor": 2, "left": 0.25}
CLOCK = {"kind": "clock", "vehicle": 12, "late_ms": 200.0, "drift_ppm": -50.0}
UTC = {"kind": "utc_step", "vehicle": 11, "at_s": 1.5, "step_ms": -20.5}
STEP = {"kind": "clock_step", "vehicle": 13, "at_s": 2.5, "step_ms": 5_000.0}
AUTOPILOT = {"kind": "autopilot_clock", "vehicle": 12, "utc_error_ms": 5.5, "drift_ppm": -50.0}
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
        (RESTART, [(2_000_000, ("end", 13)), (3_500_000, ("restart", 13))]),
        (LOSS, [(1_000_000, ("lose_gps",)), (3_000_000, ("regain_gps",))]),
        (JUMP, [(1_000_000, ("shift_gps", (1.0, 2.0, 3.0))), (3_000_000, ("shift_gps", (0.0, 0.0, 0.0)))]),
        (MOTOR, [(500_000, ("fail_rotor", 2, 0.5))]),
        (UTC, [(1_500_000, ("shift_utc", -20_500))]),
        (STEP, [(2_500_000, ("step_clock", 13, 5_000_000))]),
        (CLOCK, []),
        (AUTOPILOT, []),
    ],
)
def test_each_concerns_one_and_ends_when_it_ends(fault: dict[str, Any], calls: list[Any]) -> None:
    assert struck(fault) == calls


def test_a_partition_heals() -> None:
    assert struck(partitions=(CUT,)) == [(2_000_000, ("cut", (11, 12))), (6_000_000, ("heal", (11, 12)))]


@settings(deadline=None)
@given(st.permutations([FREEZE, VANISH, RESTART, LOSS, JUMP, MOTOR, UTC, STEP]))
def test_they_come_in_the_order_of_time(faults: list[dict[str, Any]]) -> None:
    of = scenario("antipodal-8", vehicles=3, faults=faults, partitions=(CUT,))
    found = events(of)
    assert [event.after for event in found] == sorted(event.after for event in found)
    begun = {id(event.what) for event in found if not event.over}
    assert begun == {id(event.what) for event in found}
    assert len(found) == 14
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


def test_an_autopilots_clock_and_utc_are_off_from_the_start() -> None:
    measured = {"certified": {"fleet_time": "measured"}}
    of = scenario("antipodal-8", vehicles=3, faults=[AUTOPILOT, {**AUTOPILOT, "vehicle": 13, "utc": False}])
    assert not Fleet(of, FIREFLY, 5, LOGS).autopilot(0).config.epoch_from_steps
    of = of.model_copy(update={"companion": of.companion.model_validate(measured)})
    configs = [Fleet(of, FIREFLY, 5, LOGS).autopilot(k).config for k in range(3)]
    assert [config.epoch_from_steps for config in configs] == [True, True, False]
    assert [(config.utc_error_us, config.clock_drift_ppm) for config in configs[:2]] == [
        (0, 0.0),
        (5_500, -50.0),
    ]


def test_a_disciplined_system_clock_tells_a_bound_that_holds_until_it_steps() -> None:
    of = scenario("antipodal-8", vehicles=3, faults=[CLOCK], clocks={"system_us": 3_000})
    fleet, start = Fleet(of, FIREFLY, 5, LOGS), 1_000_000_000
    for k in range(3):
        system, own = fleet.system_clock(k, start), fleet.clock(k, start)
        assert system is not None
        for true in range(start, start + 60_000_000, 1_234_000):
            now = own.local(true)
            reading = system(now)
            assert abs(now + reading.ahead - true) <= reading.bound
            # 3 ms, and the kernel's 500 ppm between two corrections.
            assert 3_000 <= reading.bound <= 3_000 + 8_000 + 4
        system.step(-5_000_000)
        assert system(now).ahead == reading.ahead - 5_000_000
        assert system(now).bound == reading.bound
    assert Fleet(scenario("antipodal-8"), FIREFLY, 5, LOGS).system_clock(0, start) is None


def spell(what: dict[str, Any], begin: float, lasts: float) -> dict[str, Any]:
    return {**what, "at_s": begin, "for_s": lasts}


@pytest.mark.parametrize("what", [FREEZE, RESTART, LOSS, JUMP, CUT])
@given(st.tuples(st.integers(0, 8), st.integers(1, 8)), st.tuples(st.integers(0, 8), st.integers(1, 8)))
@settings(deadline=None, max_examples=30)
def test_of_one_kind_one_goes_after_the_other(
    what: dict[str, Any], one: tuple[int, int], other: tuple[int, int]
) -> None:
    key = "partitions" if what is CUT else "faults"
    both = [spell(what, begin / 8.0, lasts / 8.0) for begin, lasts in (one, other)]
    apart = one[0] >= sum(other) or other[0] >= sum(one)
    if not apart:
        with pytest.raises(ValidationError, match=rf"{key}\[0\] and {key}\[1\]: .* twice at one time"):
            scenario("antipodal-8", vehicles=3, **{key: both})
        return
    found = events(scenario("antipodal-8", vehicles=3, **{key: both}))
    # It ends before it begins again, in whatever order the file has them.
    assert [event.over for event in found] == [False, True, False, True]


def test_others_may_suffer_at_the_same_time() -> None:
    faults = [FREEZE, {**FREEZE, "vehicle": 13}, spell(LOSS, 3.0, 1.0), spell(JUMP, 3.0, 1.0), MOTOR, MOTOR]
    cuts = (CUT, {**CUT, "members": [11]})
    assert len(events(scenario("antipodal-8", vehicles=3, faults=faults, partitions=cuts))) == 14


def test_a_clock_is_off_in_one_way_only() -> None:
    with pytest.raises(ValidationError, match=r"faults\[0\] and faults\[2\]: clock of 12 .* one for each"):
        scenario("antipodal-8", vehicles=3, faults=[CLOCK, FREEZE, {**CLOCK, "late_ms": 0.0}])


def test_what_lasts_no_time_ends_all_the_same() -> None:
    (begun, ended) = events(scenario("antipodal-8", vehicles=3, faults=[spell(FREEZE, 1.0, 1e-9)]))
    assert (begun.over, ended.over) == (False, True)


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
