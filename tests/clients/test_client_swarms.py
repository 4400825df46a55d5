"""Three vehicles on one port: MAVSDK 4 flies all of them, MAVSDK 3 the one that it hears first."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from client_rig import Client, Flight, python
from sitl_process import Sitl, free_port

pytestmark = pytest.mark.slow

FLAVOURS = ("px4", "ardupilot")
COUNT = 3
SPEEDUP = 2.0


@pytest.fixture(scope="module", params=FLAVOURS)
def flights(request: pytest.FixtureRequest) -> Iterator[tuple[Flight, Flight]]:
    """With MAVSDK 3 and with 4, each with vehicles of its own, at the same time."""
    pythons = python("mavsdk3"), python("mavsdk4")
    sitls = [Sitl(request.param, COUNT, speedup=SPEEDUP) for _ in pythons]
    with sitls[0], sitls[1]:
        urls = [f"udpin://127.0.0.1:{sitl.start().shared}" for sitl in sitls]
        old = Client(pythons[0], "mavsdk_grpc.py", request.param, urls[0], str(free_port()), "hop")
        new = Client(pythons[1], "mavsdk_ctypes.py", request.param, urls[1], str(COUNT))
        yield old.flight(), new.flight()


def test_mavsdk_4_flies_all_of_them(flights: tuple[Flight, Flight]) -> None:
    flight = flights[1]
    assert flight.status == 0, flight.report("it failed")
    assert {line["system"] for line in flight.every("discovered")} == {1, 2, 3}
    assert len({line["uid"] for line in flight.every("hopped")}) == COUNT
    for line in flight.every("armable"):
        assert line["after"] * SPEEDUP < 5.0
    places = {tuple(line["position"].values())[:2] for line in flight.every("landed")}
    assert len(places) == COUNT


def test_mavsdk_3_flies_one_of_them(flights: tuple[Flight, Flight]) -> None:
    flight = flights[0]
    assert flight.status == 0, flight.report("it failed")
    assert flight["hopped"]["uid"]
    assert flight["landed"]["position"]["relative_altitude_m"] == pytest.approx(0.0, abs=0.1)
