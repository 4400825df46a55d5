"""Who only rehearses flies nothing, and nothing lands it."""

from __future__ import annotations

from itertools import count

import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.dry_run import ONLOOKER, REQUESTS, DryRun
from companion.flight.readiness import OPERATORS_GO
from companion.shadow import ShadowCompanion
from companion.values.phase import Phase
from mavlink_bridge.messages import CommandLong, GpsGlobalOrigin, Source
from tests.companion.bench import AUTOPILOT, FLEET, SYSTEM, TARGET, Bench, only, seen_at


def test_an_empty_battery_of_the_vehicle_it_looks_on_at_leaves_no_gap() -> None:
    bench, stopwatch = Bench(task="escort"), count()
    bench.companion = ShadowCompanion(bench.config, SYSTEM, TARGET, FLEET, lambda: next(stopwatch))
    bench.autopilot.position[2], bench.autopilot.armed = 5.0, True
    bench.target = seen_at(TARGET, (15.0, 0.0, 0.0))
    origin = GpsGlobalOrigin(AUTOPILOT, FLEET.latitude, FLEET.longitude, FLEET.altitude, 0)
    bench.step(bench.datagram("autopilot", origin))
    bench.fly(3.0)
    assert bench.phase is Phase.ESCORT
    before = len(bench.companion.would)
    bench.autopilot.battery = 0.05
    bench.fly(1.0)
    assert any("battery" in name for name in bench.companion.health.concerns)
    assert len(bench.companion.would) - before == 50
    assert not bench.sent


def test_a_dry_run_hears_the_answers_to_what_it_asks_and_not_the_companions() -> None:
    bench, stopwatch = Bench(task="escort"), count()
    bench.companion = DryRun(bench.config, SYSTEM, TARGET, FLEET, lambda: next(stopwatch))
    bench.target = seen_at(TARGET, (15.0, 0.0, 0.0))
    bench.fly(5.0)
    pilot = bench.companion.pilot
    assert pilot.lacking == OPERATORS_GO
    asked = only(CommandLong, [(link, message) for _, link, message in bench.sent])
    assert {message.source for message in asked} == {Source(SYSTEM, ONLOOKER)}
    assert {message.command for message in asked} == set(REQUESTS)


@pytest.mark.parametrize("mute", [False, True])
def test_a_dry_run_requests_only_what_does_not_arrive_and_at_rates_for_a_radio(mute: bool) -> None:
    """The link may be a radio, or that of a companion in flight, whose 50 Hz must stay 50 Hz."""
    bench, stopwatch = Bench(task="escort"), count()
    bench.companion = DryRun(bench.config, SYSTEM, TARGET, FLEET, lambda: next(stopwatch))
    bench.autopilot.mute = mute
    bench.fly(20.0)
    asked = only(CommandLong, [(link, message) for _, link, message in bench.sent])
    intervals = {m.params[0]: m.params[1] for m in asked if m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL}
    silent = {24.0, 193.0, *((30.0, 32.0) if mute else ())}
    assert intervals.keys() == silent
    assert min(intervals.values()) >= 250_000.0
    needed = bench.companion.config.guard.own_stale_us
    assert all(intervals[number] < needed for number in silent & {30.0, 32.0})


def test_a_dry_run_requests_what_falls_silent() -> None:
    bench, stopwatch = Bench(task="escort"), count()
    bench.companion = DryRun(bench.config, SYSTEM, TARGET, FLEET, lambda: next(stopwatch))
    bench.fly(5.0)
    bench.sent.clear()
    bench.autopilot.mute = True
    bench.fly(5.0)
    asked = only(CommandLong, [(link, message) for _, link, message in bench.sent])
    assert {30.0, 32.0} <= {m.params[0] for m in asked if m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL}
