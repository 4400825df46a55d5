"""What was sent to real firmware is sent to ours, at the same times: it answers and flies as the real one
did."""

from __future__ import annotations

from itertools import combinations, groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from benchmarks.figure_eight import FIRST, FULL, PVY, SECOND, Part, distances, settings, trajectory, turns
from benchmarks.recorded_flights import RecordedFlight, Sent, fly, read_flight
from benchmarks.recorded_swarms import SwarmVehicle, read_swarm
from benchmarks.response import SWARMS
from benchmarks.swarm_responses import Deviations, Followed, closest, follow
from mavlink_bridge.messages import CommandLong, SetpointLocal
from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from outrider.errors import InputError
from tests.sitl.autopilot_rig import FIREFLY

pytestmark = pytest.mark.slow

FLIGHTS = Path(__file__).parents[1] / "data" / "flights"
LOGS = ("copter-full", "copter-pvy", "px4-pvay")
BEAT = 1.2
"""s, by which a change may be seen earlier or later: HEARTBEAT comes once a second."""
LANDING = {"ardupilot": 1.5, "px4": 8.5}
"""s, for what the ground brings about: ours counts as landed after 0.5 s and is disarmed at once. PX4's
detector took 6 s from when it touched down (its height went on rising), and 2 s more to disarm."""
NEAR = {FULL: 0.2, PVY: 0.2, FIRST: 0.65, SECOND: 0.45}
"""m, p95 on the figure-eights. The logs tell the estimate only, and that of PX4 wanders."""
D_MIN = 0.95
"""m, that was to be kept in the recorded swarms."""


class Pair(NamedTuple):
    """A recorded flight, and what ours told when it was sent the same."""

    flight: RecordedFlight
    ours: Sent


@pytest.fixture(scope="module")
def pairs() -> dict[str, Pair]:
    flights = {log: read_flight(FLIGHTS / f"{log}.tlog.gz") for log in LOGS}
    return {
        log: Pair(flight, fly(flight, FIREFLY, response="firmware", **settings(flight)))
        for log, flight in flights.items()
    }


def answers(flight: RecordedFlight, told: Sent) -> list[tuple[float, int, list[int]]]:
    """When each command was sent, which, and the results until the next was; the same one again (PX4 does so
    for DO_SET_MODE) counts once."""
    asked = [(time, m.command) for time, m in flight.sent if isinstance(m, CommandLong)]
    ends = [time for time, _ in asked[1:]] + [np.inf]
    found = []
    for (time, command), end in zip(asked, ends, strict=True):
        results = [ack.result for ack in told.acks if ack.command == command and time <= ack.time < end]
        found.append((time, command, [result for result, _ in groupby(results)]))
    return found


@pytest.mark.parametrize("log", LOGS)
def test_every_command_gets_the_same_answer(pairs: dict[str, Pair], log: str) -> None:
    flight, ours = pairs[log]
    recorded = answers(flight, flight.told)
    assert all(results for _, _, results in recorded)
    assert answers(flight, ours) == recorded


@pytest.mark.parametrize("log", LOGS)
def test_modes_and_arming_change_alike(pairs: dict[str, Pair], log: str) -> None:
    flight, ours = pairs[log]
    recorded = flight.told.modes
    assert [change[1:] for change in ours.modes] == [change[1:] for change in recorded]
    for mine, theirs in list(zip(ours.modes, recorded, strict=True))[1:]:
        landed = theirs is recorded[-1]
        patience = LANDING[flight.flavour] if landed else BEAT
        assert mine.time == pytest.approx(theirs.time, abs=patience), theirs


@pytest.mark.parametrize("log", LOGS)
def test_it_is_on_the_ground_and_in_the_air_alike(pairs: dict[str, Pair], log: str) -> None:
    flight, ours = pairs[log]
    recorded = flight.told.landings
    assert [change.landed_state for change in ours.landings] == [change.landed_state for change in recorded]
    assert ours.landings[-1].time == pytest.approx(recorded[-1].time, abs=LANDING[flight.flavour])


@pytest.mark.parametrize("part", [FULL, PVY, FIRST, SECOND], ids=str)
def test_it_is_where_the_real_one_was(pairs: dict[str, Pair], part: Part) -> None:
    flight, ours = pairs[part.log]
    errors = distances(flight, part, ours.track)
    assert len(errors) > 150
    assert np.percentile(errors, 95.0) <= NEAR[part]
    assert np.degrees(np.percentile(turns(flight, part, ours), 95.0)) <= 10.0


@pytest.mark.parametrize("log", ["copter-full", "copter-pvy"])
def test_it_comes_down_where_the_real_one_did(pairs: dict[str, Pair], log: str) -> None:
    """One stream ends with LAND, the other 5 s before: ArduPilot flies on for 3 s, brakes, and goes back to
    where the last position had got to."""
    flight, ours = pairs[log]
    end = flight.told.track[-1:, 0]
    assert np.linalg.norm(ours.position(end) - flight.told.position(end)) < 1.0


class Swarm(NamedTuple):
    """The vehicles of a recorded swarm by id, and each emulated on its own set-points."""

    vehicles: dict[int, SwarmVehicle]
    followed: dict[int, Followed]


@pytest.fixture(scope="module")
def swarms() -> dict[str, Swarm]:
    found = {}
    for name in SWARMS:
        vehicles = {vehicle.system: vehicle for vehicle in read_swarm(FLIGHTS / f"{name}.npz")}
        found[name] = Swarm(vehicles, {k: follow(vehicle) for k, vehicle in vehicles.items()})
    return found


@pytest.mark.parametrize("system", range(1, 6))
@pytest.mark.parametrize("name", SWARMS)
def test_the_emulation_is_where_each_vehicle_of_a_swarm_was(
    swarms: dict[str, Swarm], name: str, system: int
) -> None:
    """Over the whole flight against the truth, jumps of the set-points and near-collisions included."""
    swarm = swarms[name]
    found = Deviations.of(swarm.followed[system])
    assert len(swarm.followed[system].times) > 6800
    assert found.p50 <= 0.10
    assert found.p95 <= 0.35
    assert found.worst <= 0.75


def test_on_plans_that_change_height_the_emulation_is_within_a_decimetre() -> None:
    """Committed plans with vertical accelerations of 1 m/s². The vehicles fly on their estimate, so that is
    what they are compared with."""
    for vehicle in read_swarm(FLIGHTS / "arducopter-3-certified.npz"):
        found = follow(vehicle._replace(truth=vehicle.estimate))
        off = np.abs(found.places - found.truth)
        assert np.percentile(found.errors, 95.0) <= 0.10
        assert np.percentile(off[:, 2], 95.0) <= 0.04


def test_on_plans_that_change_height_a_px4_is_where_the_real_one_was() -> None:
    """With the recorded error of the estimate. What is left fits the tilt that this estimates wrongly: 1°."""
    vehicles = read_swarm(FLIGHTS / "px4-3-certified.npz")
    assert [vehicle.flavour for vehicle in vehicles] == ["px4"] * 3
    for vehicle in vehicles:
        found = follow(vehicle)
        assert np.percentile(found.errors, 95.0) <= 0.22
        assert found.errors.max() <= 0.27


@pytest.mark.parametrize("name", SWARMS)
def test_pairs_come_as_near_as_they_did(swarms: dict[str, Swarm], name: str) -> None:
    """Each flies its own recorded set-points alone, so the sum of two errors counts."""
    followed = swarms[name].followed
    for first, second in combinations(followed.values(), 2):
        emulated, true = closest(first, second)
        assert emulated == pytest.approx(true, abs=0.25)


def test_the_emulation_shows_the_near_collision(swarms: dict[str, Swarm]) -> None:
    """Vehicles 2 and 4 of five ArduCopters: nothing like it is seen at the others."""
    followed = swarms["arducopter-5"].followed
    near = {
        (first, second): closest(followed[first], followed[second])
        for first, second in combinations(followed, 2)
    }
    assert {pair for pair, (_, true) in near.items() if true < D_MIN} == {(2, 4)}
    assert {pair for pair, (emulated, _) in near.items() if emulated < D_MIN} == {(2, 4)}
    assert near[2, 4][1] < 0.15
    assert near[2, 4][0] < 0.35


def test_the_swarms_hold_what_was_recorded(swarms: dict[str, Swarm]) -> None:
    flavours = {
        name: [vehicle.flavour for vehicle in swarm.vehicles.values()] for name, swarm in swarms.items()
    }
    assert flavours == {"arducopter-5": ["ardupilot"] * 5, "mixed-3-2": ["ardupilot"] * 3 + ["px4"] * 2}
    for swarm in swarms.values():
        for vehicle in swarm.vehicles.values():
            for rows in vehicle[2:]:
                assert np.isfinite(rows).all()
                assert np.all(np.diff(rows[:, 0]) >= 0.0)
            first, last = vehicle.setpoints[[0, -1], 0]
            for rows in (vehicle.estimate, vehicle.truth):
                assert rows[0, 0] <= first
                assert rows[-1, 0] >= last - 1.0
            # 50 set-points a second.
            assert len(vehicle.setpoints) == pytest.approx(50.0 * (last - first), rel=0.01)


def test_without_the_response_it_is_where_it_is_told_to_be(pairs: dict[str, Pair]) -> None:
    """So the recorded vehicles' lag is the response's doing, and not the rest's."""
    flight = pairs["px4-pvay"].flight
    exact = fly(flight, FIREFLY, **settings(flight))
    assert np.percentile(distances(flight, SECOND, exact.track), 50.0) > 1.0
    sent = trajectory(flight)[200:]
    there = exact.position(np.array([time for time, _ in sent]))
    told = np.array([message.position for _, message in sent])
    assert np.linalg.norm(there - told, axis=1).max() < 0.15


def test_the_extracts_hold_what_was_sent(pairs: dict[str, Pair]) -> None:
    counts = {
        log: sum(isinstance(message, SetpointLocal) for _, message in pair.flight.sent)
        for log, pair in pairs.items()
    }
    assert counts == {"copter-full": 2000, "copter-pvy": 2000, "px4-pvay": 4488}
    assert {log: len(trajectory(pair.flight)) for log, pair in pairs.items()} == dict.fromkeys(LOGS, 2000)
    for flight, _ in pairs.values():
        times = [time for time, _ in flight.sent]
        assert times == sorted(times)


def test_times_are_the_vehicles_own(pairs: dict[str, Pair]) -> None:
    """PX4's simulator was 1.1 % slow, so its 40 s of set-points took 39.5 s."""
    lengths = {}
    for log, pair in pairs.items():
        sent = trajectory(pair.flight)
        lengths[log] = sent[-1][0] - sent[0][0]
    assert lengths == pytest.approx({"copter-full": 40.0, "copter-pvy": 40.0, "px4-pvay": 39.5}, abs=0.1)


def test_a_log_without_a_vehicle_is_refused(tmp_path: Path) -> None:
    source = FLIGHTS / "px4-pvay.tlog.gz"
    path = tmp_path / "alone.tlog"
    with TlogWriter(path) as log:
        for record in read_tlog(source):
            if record.frame[6] != 1:
                log.write(record.time, record.link, record.frame)
    with pytest.raises(InputError, match="alone"):
        read_flight(path)
