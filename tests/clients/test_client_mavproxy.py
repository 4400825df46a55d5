"""MAVProxy 1.8.75 at vehicles of ``outrider sitl --flavour ardupilot``: one in real time, three on one port.

Both fly at the same time, as MAVProxy waits most of the time.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from tests.clients.client_rig import python
from tests.clients.mavproxy_console import MavProxy
from tests.clients.mavproxy_flight import GOAL, HEIGHT, MavProxyFlight, MavProxySwarm
from tests.clients.sitl_process import Sitl

pytestmark = pytest.mark.slow

SYSTEMS = [1, 2, 3]
USUAL = re.compile(
    r"|Connect \S+ source_system=255|Log Directory: .*|Telemetry log: .*|Waiting for heartbeat from .*"
    r"|Detected vehicle \d:1 on link 0|online system \d|Set vehicle \d \(link 1\)|Mode [A-Z]+"
    r"|GPS lock at \d+ meters|Flight battery \d+ percent|waypoint \d|\d+: \w+ \{.*\}"
    r"|Received \d+ parameters(?: \(ftp\))?|Saved \d+ (?:parameters|defaults) to .*|[A-Z_]+ +[\d.]+"
    r"|Loaded 3 waypoints (?:from|in) .*|Sent all 3 waypoints|Got MISSION_ACK: TYPE_MISSION: ACCEPTED"
    r"|Requesting \d+ (?:waypoints|fence items|rally items) t=.*|\d+ \d [-\d. ]+ p1=.* auto=1"
    r"|Saved (?:3 )?waypoints to .*|Got COMMAND_ACK: [A-Z_]+: ACCEPTED|AP: Armed|AP: Landed, disarmed"
    r"|AP: Set-points timed out|(?:DIS)?ARMED|Taking off to .* meters"
    r"|x:.*, y:.*, z:.*|Guided \(.*\) .* frame 3|Unloading module \w+"
)
"""All that MAVProxy may say. Anything else is a warning, or news that someone has to look at. It sends a
velocity once, and the vehicle takes longer to come to rest than GUID_TIMEOUT."""


@pytest.fixture(scope="module")
def flights(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[Future[MavProxyFlight], Future[MavProxySwarm]]]:
    """The one vehicle's, and that of three on one port."""
    interpreter = python("mavproxy")
    with (
        Sitl("ardupilot", 1) as one,
        Sitl("ardupilot", 3, speedup=3.0) as three,
        ThreadPoolExecutor() as pool,
    ):
        one.start()
        folder = tmp_path_factory.mktemp("one")
        alone = pool.submit(MavProxyFlight, interpreter, one.endpoint(0), folder)
        three.start()
        folder, port = tmp_path_factory.mktemp("three"), f"udpin:127.0.0.1:{three.shared}"
        yield alone, pool.submit(MavProxySwarm, interpreter, port, folder, SYSTEMS)


@pytest.fixture
def flight(flights: tuple[Future[MavProxyFlight], Future[MavProxySwarm]]) -> MavProxyFlight:
    """Of one vehicle. Raises what went wrong."""
    return flights[0].result()


@pytest.fixture
def swarm(flights: tuple[Future[MavProxyFlight], Future[MavProxySwarm]]) -> MavProxySwarm:
    """Of three."""
    return flights[1].result()


def unusual(proxy: MavProxy) -> list[str]:
    return [line.text for line in proxy.lines if not USUAL.fullmatch(line.text)]


def test_it_says_nothing_unusual(flight: MavProxyFlight) -> None:
    assert not unusual(flight.proxy)


def test_modes_are_known_by_name(flight: MavProxyFlight) -> None:
    modes = [line.text for line in flight.proxy.lines if line.text.startswith("Mode ")]
    assert modes == ["Mode STABILIZE", "Mode GUIDED", "Mode LAND"]


def test_all_parameters_arrive_within_three_seconds(flight: MavProxyFlight) -> None:
    assert flight.parameters > 200
    assert flight.proxy.when("Received") - flight.proxy.when("online system") < 3.0


def test_lists(flight: MavProxyFlight) -> None:
    assert (flight.waypoints, flight.fences, flight.rallies) == (3, 0, 0)


def test_takeoff(flight: MavProxyFlight) -> None:
    assert math.dist(flight.up, (0.0, 0.0, -HEIGHT)) < 0.1


def test_velocity_goes_forward(flight: MavProxyFlight) -> None:
    assert math.dist(flight.velocity, (1.0, 0.0, 0.0)) < 0.15


def test_position_is_an_offset(flight: MavProxyFlight) -> None:
    moved = [after - before for after, before in zip(flight.after, flight.before, strict=True)]
    assert math.dist(moved, (3.0, 2.0, -1.0)) < 0.1


def test_guided_goes_to_a_place(flight: MavProxyFlight) -> None:
    latitude, longitude, height = flight.there
    assert latitude == pytest.approx(GOAL[0], abs=1e-6)
    assert longitude == pytest.approx(GOAL[1], abs=1e-6)
    assert height == pytest.approx(GOAL[2], abs=0.1)


def test_it_lands(flight: MavProxyFlight) -> None:
    assert abs(flight.down[2]) < 0.05


def test_three_vehicles_on_one_port(swarm: MavProxySwarm) -> None:
    assert set(swarm.heights) == set(SYSTEMS)
    for height in swarm.heights.values():
        assert height == pytest.approx(HEIGHT, abs=0.1)
    assert not unusual(swarm.proxy)
