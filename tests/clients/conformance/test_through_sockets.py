"""Flights and transfers of the three suites once more, in real time and through ``outrider sitl``'s ports.

ArduPilot by TCP, PX4 by UDP. They are the same functions as under the simulated clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.clients.conformance import test_arducopter_autotest as arducopter
from tests.clients.conformance import test_mavsdk_system_tests as mavsdk
from tests.clients.conformance import test_px4_mavsdk_tests as px4
from tests.clients.conformance.socket_stand import OPTIONS, SocketStand
from tests.clients.conformance.stand import Stand
from tests.clients.sitl_process import Sitl
from tests.sitl.autopilot_rig import FLAVOURS

pytestmark = pytest.mark.slow
SPEEDUP = 5.0
FLIGHTS = {
    "ardupilot": (
        arducopter.test_guided_moves_and_stops,
        arducopter.test_mission_is_flown_and_ends_disarmed,
        arducopter.test_pause_and_continue_in_guided,
    ),
    "px4": (
        px4.test_offboard_position_control,
        px4.test_takeoff_and_land,
        px4.test_square_mission_with_rtl,
    ),
}


@pytest.fixture
def client(request: pytest.FixtureRequest) -> Iterator[Stand]:
    with Sitl(request.param, 1, speedup=SPEEDUP, options=OPTIONS) as sitl:
        sitl.start()
        stand = SocketStand(sitl)
        yield stand
        stand.rig.close()
        sitl.stop()


@pytest.mark.parametrize(
    ("client", "flight"),
    [(flavour, flight) for flavour in FLAVOURS for flight in FLIGHTS[flavour]],
    indirect=["client"],
)
def test_flights(client: Stand, flight: Callable[[Stand], None]) -> None:
    """arducopter.py and mavsdk_tests."""
    flight(client)


@pytest.mark.parametrize("client", FLAVOURS, indirect=True)
def test_transfers_and_parameters(client: Stand) -> None:
    """MAVSDK system_tests, one after another."""
    mavsdk.test_mission_transfer_lossy(client, 0)
    mavsdk.test_a_parameter_is_set_and_read(client)
    mavsdk.test_sequence_numbers_have_no_gap(client)
    mavsdk.test_arm_and_disarm(client)
