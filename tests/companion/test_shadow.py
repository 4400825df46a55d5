"""Who only rehearses flies nothing, and nothing lands it."""

from __future__ import annotations

from itertools import count

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
    bench.fly(3.0)
    pilot = bench.companion.pilot
    assert pilot.lacking == OPERATORS_GO
    asked = only(CommandLong, [(link, message) for _, link, message in bench.sent])
    assert {message.source for message in asked} == {Source(SYSTEM, ONLOOKER)}
    assert {message.command for message in asked} == set(REQUESTS)
