"""Other people's clients, as they come from PyPI, each flying a vehicle of ``outrider sitl``: discovery,
health, telemetry, parameters, plans, flight.

All fly at the same time, as each waits most of the time. Those that speak UDP listen before their vehicle
boots, so that its first heartbeat is the first that they hear.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from tests.clients.client_rig import Client, Flight, available, python
from tests.clients.sitl_process import Sitl, free_port

pytestmark = pytest.mark.slow

FLAVOURS = ("px4", "ardupilot")
MAVSDK = ("mavsdk3", "mavsdk4")
CLIENTS = (*MAVSDK, "pymavlink")
HEIGHT = 3.0
SPEEDUP = 2.0


def launch(client: str, sitl: Sitl, index: int) -> Client:
    """One client on one vehicle."""
    if client == "mavsdk3":
        words = (sitl.flavour, sitl.url(index), str(free_port()))
        return Client(python(client), "mavsdk_grpc.py", *words)
    if client == "mavsdk4":
        return Client(python(client), "mavsdk_ctypes.py", sitl.flavour, sitl.url(index))
    return Client(python(client), "pymavlink_flight.py", sitl.flavour, sitl.endpoint(index))


@pytest.fixture(scope="module")
def flights() -> Iterator[dict[tuple[str, str], Flight]]:
    """By client and flavour."""
    there = [(index, client) for index, client in enumerate(CLIENTS) if available(client)]
    flying = {}
    with ExitStack() as stack:
        for flavour in FLAVOURS:
            sitl = stack.enter_context(Sitl(flavour, len(CLIENTS), speedup=SPEEDUP))
            # TCP calls somebody, UDP listens.
            if flavour == "ardupilot":
                sitl.start()
            for index, client in there:
                flying[client, flavour] = launch(client, sitl, index)
                stack.callback(flying[client, flavour].end)
            if flavour == "px4":
                sitl.start()
        yield {which: client.flight() for which, client in flying.items()}


@pytest.fixture(params=[f"{client}-{flavour}" for flavour in FLAVOURS for client in CLIENTS])
def flight(request: pytest.FixtureRequest, flights: dict[tuple[str, str], Flight]) -> Flight:
    """Each of them."""
    client, flavour = request.param.split("-")
    python(client)
    return flights[client, flavour]


@pytest.fixture(params=[f"{client}-{flavour}" for flavour in FLAVOURS for client in MAVSDK])
def by_mavsdk(request: pytest.FixtureRequest, flights: dict[tuple[str, str], Flight]) -> Flight:
    """Each with MAVSDK."""
    client, flavour = request.param.split("-")
    python(client)
    return flights[client, flavour]


def test_it_goes_well_to_the_end(flight: Flight) -> None:
    assert flight.status == 0, flight.report("it failed")
    assert flight["done"]
    assert not [line for line in flight.told if line["what"] == "failed"]


def test_it_is_the_client_that_was_meant(flights: dict[tuple[str, str], Flight]) -> None:
    for client, version in (("mavsdk3", "3.17.4"), ("mavsdk4", "4.1.0")):
        for flavour in FLAVOURS if available(client) else ():
            assert flights[client, flavour]["discovered"]["client"] == version


def test_armable_within_five_seconds_of_the_first_heartbeat(flight: Flight) -> None:
    # Whatever part of it is the vehicle's would take so much longer in real time.
    assert flight["armable"]["after"] * SPEEDUP < 5.0


def test_every_health_flag_is_good(by_mavsdk: Flight) -> None:
    flags = by_mavsdk["healthy"]["flags"]
    assert len(flags) == 7
    assert all(flags.values())


def test_telemetry_shows_a_vehicle_at_rest(by_mavsdk: Flight) -> None:
    seen = by_mavsdk["telemetry"]
    position, home, origin = seen["position"], seen["home"], by_mavsdk["origin"]["origin"]
    for axis in ("latitude_deg", "longitude_deg"):
        assert position[axis] == pytest.approx(home[axis], abs=1e-6)
        assert position[axis] == pytest.approx(origin[axis], abs=1e-3)
    assert position["absolute_altitude_m"] == pytest.approx(home["absolute_altitude_m"], abs=0.1)
    assert position["relative_altitude_m"] == pytest.approx(0.0, abs=0.1)
    attitude, q = seen["attitude_euler"], seen["attitude_quaternion"]
    assert abs(attitude["roll_deg"]) < 1.0
    assert abs(attitude["pitch_deg"]) < 1.0
    assert math.hypot(q["w"], q["x"], q["y"], q["z"]) == pytest.approx(1.0, abs=1e-3)
    assert all(abs(speed) < 0.05 for speed in seen["velocity_ned"].values())
    assert (seen["landed_state"], seen["in_air"], seen["armed"]) == ("ON_GROUND", False, False)
    assert (seen["gps_info"]["fix_type"], seen["raw_gps"]["latitude_deg"]) == (
        "FIX_3D",
        pytest.approx(home["latitude_deg"], abs=1e-5),
    )


def test_the_battery_is_full_of_plausible_volts(by_mavsdk: Flight) -> None:
    battery = by_mavsdk["telemetry"]["battery"]
    assert 90.0 < battery["remaining_percent"] <= 100.0
    assert 3.0 * 3.5 < battery["voltage_v"] < 6.0 * 4.3


def test_modes_have_their_names(flights: dict[tuple[str, str], Flight]) -> None:
    boots = {"px4": "HOLD", "ardupilot": "STABILIZED"}
    for (client, flavour), flight in flights.items():
        if client in MAVSDK:
            assert flight["telemetry"]["flight_mode"] == boots[flavour]
            assert flight["by position"]["mode"] == "OFFBOARD"
            assert flight["stopped"]["mode"] == "HOLD"
            assert flight["mission flown"]["mode"] == "MISSION"
            assert flight["landed"]["mode"] == "LAND"


def test_who_it_says_it_is(by_mavsdk: Flight) -> None:
    version = by_mavsdk["info"]["version"]
    numbers = version["flight_sw_major"], version["flight_sw_minor"], version["flight_sw_patch"]
    assert (numbers, version["flight_sw_version_type"]) in (((4, 6, 3), "RELEASE"), ((1, 16, 1), "RELEASE"))
    assert int(by_mavsdk["info"]["identity"]["hardware_uid"].rstrip("\0"), 16)


def test_parameters_are_listed_and_kept(by_mavsdk: Flight) -> None:
    found = by_mavsdk["parameters"]
    assert found["integers"] > 50
    assert found["floats"] > 50
    for kind in ("integer", "float"):
        line = by_mavsdk[kind]
        assert line["now"] == line["set"] != line["was"]


def test_plans_come_back_as_they_went(by_mavsdk: Flight) -> None:
    for kind, items in (("mission", (3, 4)), ("fence", (3,)), ("rally", (1,))):
        up, down = by_mavsdk[kind]["up"], by_mavsdk[kind]["down"]
        assert len(up) in items
        assert [_plan(item) for item in down] == [_plan(item) for item in up]


def _plan(item: dict[str, Any]) -> dict[str, Any]:
    """Return the item without what changes, and to a millimetre: ArduPilot's item 0 is always its home."""
    found = {name: round(value, 3) if isinstance(value, float) else value for name, value in item.items()}
    del found["current"]
    return found


def test_takeoff_leads_to_the_height_that_was_set(by_mavsdk: Flight) -> None:
    line = by_mavsdk["taken off"]
    assert line["asked"] == HEIGHT
    assert line["state"] in ("TAKING_OFF", "IN_AIR")
    assert line["position"]["relative_altitude_m"] == pytest.approx(HEIGHT, abs=0.4)


def test_set_points_are_followed(flight: Flight) -> None:
    told = [line for line in flight.told if line["what"].startswith("by ")]
    assert len(told) >= 3
    for line in told:
        if "position" not in line:
            assert math.dist(_numbers(line["velocity"]), _numbers(line["wanted"])[:3]) < 0.2
            continue
        assert math.dist(_numbers(line["position"]), _numbers(line["goal"])[:3]) < 0.25


def _numbers(value: Any) -> list[float]:
    return list(value.values()) if isinstance(value, dict) else list(value)


def test_stopping_ends_offboard(by_mavsdk: Flight) -> None:
    assert by_mavsdk["by both"]["active"]
    assert not by_mavsdk["stopped"]["active"]


def test_an_uploaded_mission_flies_to_its_end(by_mavsdk: Flight) -> None:
    line = by_mavsdk["mission flown"]
    assert line["progress"]["current"] == line["progress"]["total"] == len(by_mavsdk["mission"]["up"])
    at = line["position"]
    assert math.dist((at["north_m"], at["east_m"], -at["down_m"]), (5.0, 5.0, HEIGHT + 1.0)) < 2.5


def test_it_lands(by_mavsdk: Flight) -> None:
    assert by_mavsdk["landed"]["position"]["relative_altitude_m"] == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_pymavlink_hears_at_the_rate_that_it_asks_for(
    flights: dict[tuple[str, str], Flight], flavour: str
) -> None:
    line = flights["pymavlink", flavour]["rates"]
    assert set(line["periods_ms"]) == {"ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"}
    for period in line["periods_ms"].values():
        # A machine that is too busy skips deadlines; the usual rates are further off than that.
        assert 0.9 * line["asked_ms"] < period < 1.5 * line["asked_ms"]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_pymavlink_gets_all_parameters_and_sets_one(
    flights: dict[tuple[str, str], Flight], flavour: str
) -> None:
    flight = flights["pymavlink", flavour]
    assert flight["parameters"]["count"] == flight["parameters"]["said"] > 100
    assert flight["parameter"]["now"] == pytest.approx(flight["parameter"]["was"] + 0.5)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_pymavlink_flies_in_the_usual_mode_and_lands(
    flights: dict[tuple[str, str], Flight], flavour: str
) -> None:
    flight = flights["pymavlink", flavour]
    assert flight["taken off"]["result"] == 0
    assert flight["taken off"]["mode"] == {"px4": "OFFBOARD", "ardupilot": "GUIDED"}[flavour]
    assert abs(flight["landed"]["position"][2]) < 0.1
