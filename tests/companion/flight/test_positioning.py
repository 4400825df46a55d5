"""How well the own autopilot knows where it is, by what it says of GPS and of its estimator."""

from __future__ import annotations

import math
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.positioning import Positioning
from companion.obstacles.uncertainty import ReportedUncertainty
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.messages import EkfStatus, EstimatorStatus, GpsRaw
from mavlink_bridge.wire.uncertainty import pack
from tests.companion.bench import AUTOPILOT
from tests.companion.rig import LAWS, numbers

SECOND = 1_000_000
READY, LOST = 0x33F, 0xA5
NAN = math.nan


def gps(fix):
    return GpsRaw(AUTOPILOT, 1, fix, 0.0, 0.0, 0.0, None, None, None, None, None, 0.0, 0.0, 0.0, 0.0)


def ekf(flags=READY, ratio=0.05):
    return EkfStatus(AUTOPILOT, flags, 0.05, ratio)


def estimator(flags=READY, ratio=0.05, accuracy=0.3):
    return EstimatorStatus(AUTOPILOT, 1, 0.05, ratio, 0.05, 0.05, NAN, NAN, accuracy, 0.3, flags)


class Case(NamedTuple):
    """What is heard when all is well, then, and what that is called."""

    good: tuple[object, ...]
    bad: object
    trouble: str


CASES = {
    "no fix": Case((gps(3),), gps(1), "GPS is lost"),
    "a fix in the plane": Case((gps(6),), gps(2), "GPS is lost"),
    "no position, ArduPilot": Case((gps(3), ekf()), ekf(LOST), "Estimator has no position"),
    "no position, PX4": Case((gps(3), estimator()), estimator(LOST), "Estimator has no position"),
    "refused, ArduPilot": Case((gps(3), ekf()), ekf(ratio=1.0), "Estimator refuses GPS"),
    "refused, PX4": Case((gps(3), estimator()), estimator(ratio=1.2), "Estimator refuses GPS"),
}


@pytest.mark.parametrize("name", CASES)
def test_trouble_is_named_grows_with_time_and_is_over_two_seconds_after_it_ends(name):
    case, found = CASES[name], Positioning()
    for message in case.good:
        found.receive(message)
    found.tick(SECOND)
    assert (found.trouble, found.radius) == ("", 0.0)
    found.receive(case.bad)
    found.tick(2 * SECOND)
    assert found.trouble == case.trouble
    radii = []
    for k in range(300):
        found.tick(2 * SECOND + 100_000 * k)
        radii.append(found.radius)
    assert radii[0] == 0.0
    assert radii[80] == pytest.approx(0.05 * 8.0**2)
    assert radii == sorted(radii)
    assert radii[-1] == 10.0
    for message in case.good:
        found.receive(message)
    found.tick(40 * SECOND)
    assert (found.trouble, found.radius) == ("", 10.0)
    found.tick(42 * SECOND)
    assert found.radius == 0.0


@LAWS
@given(
    received=st.lists(
        st.sampled_from([gps(0), gps(1), ekf(LOST), ekf(0x4A1), estimator(0xA1), estimator(0xA1, NAN)]),
        max_size=9,
    )
)
def test_who_never_had_gps_misses_none(received):
    """Cameras, or not ready yet."""
    found = Positioning()
    for k, message in enumerate(received):
        found.receive(message)
        found.tick(k * SECOND)
        assert (found.trouble, found.radius) == ("", 0.0)


@LAWS
@given(worse=numbers(0.0, 4.0), after=numbers(0.0, 9.0))
def test_what_the_estimator_says_of_itself_counts_where_it_is_more(worse, after):
    found = Positioning()
    for message in (gps(3), estimator(accuracy=0.4)):
        found.receive(message)
    found.tick(0)
    for message in (gps(1), estimator(accuracy=0.4 + worse)):
        found.receive(message)
    found.tick(0)
    now = round(1e6 * after)
    found.tick(now)
    assert found.radius == pytest.approx(max(2.0 * worse, 0.05 * (1e-6 * now) ** 2))


def test_a_short_loss_begins_anew():
    found = Positioning()
    for k in range(40):
        found.receive(gps(3 if k % 4 else 1))
        found.tick(k * SECOND)
        # One second in four; where it has faded meanwhile nothing is left.
        assert found.radius <= 0.05


@LAWS
@given(
    told=st.lists(st.tuples(st.integers(1, 255), numbers(0.0, 600.0), st.integers(0, 9 * SECOND)), max_size=9)
)
def test_what_others_say_counts_for_three_seconds_and_for_ten_metres_at_most(told):
    doubts = ReportedUncertainty()
    for system, radius, when in sorted(told, key=lambda one: one[2]):
        doubts.receive(when, system, pack(radius))
    now = 9 * SECOND
    last = {system: (when, radius) for system, radius, when in sorted(told, key=lambda one: one[2])}
    counts = {s for s, (when, radius) in last.items() if now - when <= 3 * SECOND and radius > 0.0}
    assert doubts.systems(now) == counts
    ids = sorted(last)
    for system, radius in zip(ids, doubts.radii(ids).tolist(), strict=True):
        expected = min(last[system][1], 10.0) if system in counts else 0.0
        assert expected - 1e-9 <= radius <= expected + 0.0101
    with pytest.raises(PlanWireError):
        doubts.receive(now, 7, b"\x02\0\0\0")
