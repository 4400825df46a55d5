"""Who only rehearses flies nothing, and nothing lands it."""

from __future__ import annotations

from itertools import count

from companion_bench import AUTOPILOT, FLEET, SYSTEM, TARGET, Bench, seen_at

from companion.pilot import Phase
from companion.understudy import Understudy
from mavlink_bridge.messages import GpsGlobalOrigin


def test_an_empty_battery_of_the_vehicle_it_looks_on_at_leaves_no_gap() -> None:
    bench, stopwatch = Bench(task="escort"), count()
    bench.companion = Understudy(bench.config, SYSTEM, TARGET, FLEET, lambda: next(stopwatch))
    bench.autopilot.position[2], bench.autopilot.armed = 5.0, True
    bench.target = seen_at(TARGET, (15.0, 0.0, 0.0))
    origin = GpsGlobalOrigin(AUTOPILOT, FLEET.latitude, FLEET.longitude, FLEET.altitude, 0)
    bench.step(bench.datagram("autopilot", origin))
    bench.fly(3.0)
    assert bench.phase is Phase.ESCORT
    before = len(bench.companion.would)
    bench.autopilot.battery = 0.05
    bench.fly(1.0)
    assert any("battery" in name for name in bench.companion.watch.concerns)
    assert len(bench.companion.would) - before == 50
    assert not bench.sent
