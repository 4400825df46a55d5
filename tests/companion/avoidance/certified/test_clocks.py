"""Clocks are watched by round trips: a right one is never called wrong, whatever the delays, and only a
companion speaks for its vehicle."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.clocks import ClockWatch
from mavlink_bridge.messages import Source, Timesync
from tests.companion.avoidance.certified.plans import EPOCH

OWN, OTHER, AUTOPILOT = Source(1, 195), Source(2, 195), Source(2, 1)
BOUND = 5_000
delays = st.integers(0, 2_000_000)


def asked(
    watch: ClockWatch, ahead: int, there: int, back: int, *, now: int = EPOCH, of: Source = OTHER
) -> None:
    """One round trip, ``there`` and ``back`` µs long, to a clock that is ``ahead`` (µs)."""
    (request,) = watch.due(now)
    reply = Timesync(of, 1000 * (now + there + ahead), request.ts1)
    if of.component == OWN.component:
        assert ClockWatch(of, BOUND).receive(now + there + ahead, request) == [reply]
    assert watch.receive(now + there + back, reply) == []


@given(st.integers(-2 * BOUND, 2 * BOUND), st.lists(st.tuples(delays, delays), min_size=1, max_size=4))
def test_no_delay_makes_a_right_clock_wrong(ahead: int, trips: list[tuple[int, int]]) -> None:
    watch = ClockWatch(OWN, BOUND)
    for count, (there, back) in enumerate(trips):
        asked(watch, ahead, there, back, now=EPOCH + count * 5_000_000)
        known = watch.ahead[OTHER.system]
        assert known.least <= ahead <= known.most
    assert not watch.wrong


@pytest.mark.parametrize("ahead", [-60_000, 60_000, 3_600_000_000])
def test_one_that_is_off_by_more_than_a_round_trip_hides_is_wrong(ahead: int) -> None:
    watch = ClockWatch(OWN, BOUND)
    asked(watch, ahead, 20_000, 20_000)
    assert watch.wrong == {OTHER.system}


@given(st.integers(1 - EPOCH, EPOCH))
def test_an_autopilot_says_nothing_of_its_vehicles_clock(ahead: int) -> None:
    """It answers as well where links are joined, by the time since it was switched on."""
    watch = ClockWatch(OWN, BOUND)
    asked(watch, ahead, 10_000, 10_000, of=AUTOPILOT)
    assert not watch.ahead
    asked(watch, 0, 10_000, 10_000, now=EPOCH + 1_000_000)
    asked(watch, ahead, 10_000, 10_000, now=EPOCH + 2_000_000, of=AUTOPILOT)
    assert not watch.wrong
    assert abs(watch.ahead[OTHER.system].most) <= 20_000


@pytest.mark.parametrize("component", [1, 191, 192, 240, 0])
@pytest.mark.parametrize("system", [OWN.system, OTHER.system])
def test_whoever_is_no_companion_is_not_answered(system: int, component: int) -> None:
    """Ten PX4s on the swarm link ask a hundred times a second."""
    watch = ClockWatch(OWN, BOUND)
    assert watch.receive(EPOCH, Timesync(Source(system, component), 0, 1000 * EPOCH)) == []
    assert watch.receive(EPOCH, Timesync(OTHER, 0, 1000 * EPOCH)) == [
        Timesync(OWN, 1000 * EPOCH, 1000 * EPOCH)
    ]
