"""DroneKit 2.9.2, as it comes from PyPI, flies an ArduPilot of ``outrider sitl``: parameters, an empty
mission, take-off, ``simple_goto``, landing."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.clients.client_rig import Client, Flight, python
from tests.clients.sitl_process import Sitl

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def flight() -> Iterator[Flight]:
    interpreter = python("dronekit")
    with Sitl("ardupilot", 1, speedup=2.0) as sitl:
        sitl.start()
        client = Client(interpreter, "dronekit_flight.py", sitl.endpoint(0))
        try:
            yield client.flight()
        finally:
            client.end()


def test_it_goes_well_to_the_end(flight: Flight) -> None:
    assert flight.status == 0, flight.report("it failed")
    assert flight["done"]


def test_an_empty_mission_is_home_alone(flight: Flight) -> None:
    assert flight["downloaded"]["count"] == 0
    assert flight["downloaded"]["home"] == pytest.approx([47.397742, 8.545594, 488.0], abs=0.5)
    assert flight["connected"]["parameters"] > 200


def test_simple_goto_goes_there(flight: Flight) -> None:
    there = flight["there"]
    assert there["north"] == pytest.approx(5.56, abs=0.4)
    assert there["east"] == pytest.approx(0.0, abs=0.3)
    assert there["down"] == pytest.approx(-4.0, abs=0.3)
    assert abs(flight["landed"]["height"]) < 0.5
