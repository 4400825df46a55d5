"""A vehicle whose time runs slower than its companion's is flown as any other: a simulation on a busy
machine, whose companion lives by the wall's time."""

from __future__ import annotations

import numpy as np
import pytest

from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.messages import CommandInt, GlobalPosition, Timesync
from tests.scenarios.single_vehicle import OPERATOR, RETURN, SITE, SYSTEM, SingleVehicle


def uneven(rate, stall, every):
    """``stall`` µs are lost at once in every ``every`` s, the rest of what ``rate`` loses all the time."""

    def pace(passed):
        whole, part = divmod(passed, round(1e6 * every))
        lost = whole * stall + min(part, stall)
        return (passed - lost) if rate == 1.0 else round(rate * (passed - lost))

    return pace


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pace", "share"),
    [(uneven(0.94, 0, 1.0), 0.06), (uneven(0.99, 0, 1.0), 0.01), (uneven(1.0, 400_000, 7.0), 0.057)],
    ids=["at 0.94", "at 0.99", "0.4 s lost every 7 s"],
)
@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_lost_time_is_made_good_all_the_way(flavour, pace, share):
    vehicle = SingleVehicle(flavour, pace=pace).fly()
    start = vehicle.place[:2].copy()
    go_to(vehicle, [12.0, 8.0, 6.0])
    oldest = 0
    for _ in range(6000):
        vehicle.step()
        view = vehicle.companion.world.at(vehicle.now)
        oldest = max(oldest, view.own.age)
    assert oldest < 500_000
    assert np.linalg.norm(vehicle.place - [12.0, 8.0, 6.0]) < 0.1
    assert vehicle.companion.world.clock_lost > 0.8 * share * 60e6
    assert not any("Own position" in text for text in vehicle.texts)
    # Its neighbours hear of it all the while.
    shared = [time for time, link, m in vehicle.sent if link == "swarm" and isinstance(m, GlobalPosition)]
    assert np.diff(shared).max() <= 110_000
    vehicle.order(RETURN)
    vehicle.until(Phase.DONE)
    assert np.linalg.norm(vehicle.place[:2] - start) < 0.6
    assert vehicle.companion.avoidance.held < 60


def test_a_clock_that_loses_much_is_told_of_and_a_good_one_is_not_asked():
    vehicle = SingleVehicle("px4", pace=uneven(0.94, 0, 1.0)).fly().run(15.0)
    assert "Autopilot's clock is slow: followed" in vehicle.texts
    vehicle = SingleVehicle("px4").fly().run(15.0)
    assert not any(isinstance(message, Timesync) for _, _, message in vehicle.sent)
    assert not any("clock" in text for text in vehicle.texts)


def test_an_autopilot_that_answers_nothing_is_named():
    vehicle = SingleVehicle("px4", pace=uneven(0.94, 0, 1.0))
    vehicle.timeless = True
    vehicle.fly().run(10.0)
    assert "Autopilot is heard late: slow link or clock" in vehicle.texts


def go_to(vehicle, place):
    latitude, longitude, altitude = SITE.to_geodetic(np.array(place))
    x, y = round(1e7 * latitude), round(1e7 * longitude)
    order = CommandInt(OPERATOR, SYSTEM, COMPONENT, 0, 192, (-1.0, 0.0, 0.0, float("nan")), x, y, altitude)
    vehicle.step(order)
