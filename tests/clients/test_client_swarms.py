"""Three vehicles on one port: MAVSDK 4 flies all of them, MAVSDK 3 the one that it hears first."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from itertools import product

import pytest

from tests.clients.client_rig import Client, Flight, python
from tests.clients.sitl_process import Sitl, free_port

pytestmark = pytest.mark.slow

FLAVOURS = ("px4", "ardupilot")
COUNT = 3


@pytest.fixture(scope="module")
def flights() -> Iterator[dict[tuple[str, str], Flight]]:
    """By client and flavour, each with vehicles of its own, all at the same time."""
    pythons = {client: python(client) for client in ("mavsdk3", "mavsdk4")}
    with ExitStack() as stack:
        flying = {}
        for client, flavour in product(pythons, FLAVOURS):
            sitl = stack.enter_context(Sitl(flavour, COUNT)).start()
            url = f"udpin://127.0.0.1:{sitl.shared}"
            if client == "mavsdk3":
                words = ("mavsdk_grpc.py", flavour, url, str(free_port()), "hop")
            else:
                words = ("mavsdk_ctypes.py", flavour, url, str(COUNT))
            flying[client, flavour] = Client(pythons[client], *words)
            stack.callback(flying[client, flavour].end)
        yield {which: client.flight() for which, client in flying.items()}


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_mavsdk_4_flies_all_of_them(flights: dict[tuple[str, str], Flight], flavour: str) -> None:
    flight = flights["mavsdk4", flavour]
    assert flight.status == 0, flight.report("it failed")
    assert {line["system"] for line in flight.every("discovered")} == {1, 2, 3}
    assert len({line["uid"] for line in flight.every("hopped")}) == COUNT
    for line in flight.every("armable"):
        assert line["after"] < 5.0
    places = {tuple(line["position"].values())[:2] for line in flight.every("landed")}
    assert len(places) == COUNT


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_mavsdk_3_flies_one_of_them(flights: dict[tuple[str, str], Flight], flavour: str) -> None:
    flight = flights["mavsdk3", flavour]
    assert flight.status == 0, flight.report("it failed")
    assert flight["hopped"]["uid"]
    assert flight["landed"]["position"]["relative_altitude_m"] == pytest.approx(0.0, abs=0.1)
