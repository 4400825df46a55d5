"""Who may speak to the view: with a real server, by the headers that a browser would send."""

from __future__ import annotations

import http.client
from collections.abc import Iterator
from typing import Any

import pytest
from websockets.asyncio import server as served
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from outrider.view.origin_check import admits
from outrider.view.page_server import PageServer

PROTOCOL: Any = ["viser-v0"]


@pytest.mark.parametrize(
    ("host", "origins", "answered"),
    [
        ("localhost:8080", [], True),
        ("localhost:8080", ["http://localhost:8080"], True),
        ("LocalHost:8080", ["http://localhost:8080"], True),
        ("127.0.0.1:8080", ["http://127.0.0.1:8080"], True),
        ("[::1]:8080", ["http://[::1]:8080"], True),
        ("10.0.0.7", ["http://10.0.0.7"], True),
        ("localhost:8080", ["http://localhost:8081"], False),
        ("localhost:8080", ["https://localhost:8080"], False),
        ("localhost:8080", ["http://elsewhere.example"], False),
        ("localhost:8080", ["null"], False),
        ("localhost:8080", ["http://localhost:8080", "http://elsewhere.example"], False),
        ("elsewhere.example:8080", ["http://elsewhere.example:8080"], False),
        ("elsewhere.example:8080", [], False),
        ("localhost.elsewhere.example", [], False),
        ("[", [], False),
        ("", [], False),
        (None, [], False),
    ],
)
def test_only_the_own_page_by_a_number_or_as_localhost(
    host: str | None, origins: list[str], answered: bool
) -> None:
    assert admits(host, origins) is answered


def test_the_name_that_it_was_told_to_serve_at_is_its_own() -> None:
    assert admits("robot.local:8080", ["http://robot.local:8080"], ("localhost", "robot.local"))


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    page_server = PageServer("127.0.0.1", 8190)
    yield page_server.server.get_port()
    page_server.stop()


def test_the_library_is_as_it_was_once_the_server_stands(port: int) -> None:
    assert not hasattr(served.serve, "__wrapped__")


@pytest.mark.parametrize("origin", [None, "http://{there}"])
def test_its_own_page_is_connected(port: int, origin: str | None) -> None:
    there = f"127.0.0.1:{port}"
    said: Any = origin and origin.format(there=there)
    with connect(f"ws://{there}", origin=said, subprotocols=PROTOCOL):
        pass


def test_a_page_of_somebody_else_is_not_connected(port: int) -> None:
    said: Any = "http://elsewhere.example"
    with pytest.raises(InvalidStatus) as refusal:
        connect(f"ws://127.0.0.1:{port}", origin=said, subprotocols=PROTOCOL)
    assert refusal.value.response.status_code == 403


@pytest.mark.parametrize(("host", "status"), [("localhost", 200), ("a.example", 403)])
def test_who_was_led_here_by_another_name_gets_nothing(port: int, host: str, status: int) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)
    connection.request("GET", "/", headers={"Host": f"{host}:{port}"})
    response = connection.getresponse()
    assert response.status == status
    assert (response.headers["Content-Security-Policy"] == "frame-ancestors 'none'") is (status == 200)
    connection.close()
