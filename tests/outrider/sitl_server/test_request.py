"""What ``outrider sitl`` is asked for: options checked, places and ports worked out, work divided."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import TypeVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.links.endpoints import Multicast, TcpIn, UdpIn, UdpOut, parse_endpoint
from outrider.address_scope import exposed
from outrider.errors import InputError
from outrider.scenarios.places import Origin
from outrider.sitl_server.addresses import addresses, extra
from outrider.sitl_server.processes import groups
from outrider.sitl_server.request import MOST_ID, Options, Request, checked
from outrider.sitl_server.worker import PERIOD, period
from sitl.autopilot.saved import Saved

Found = TypeVar("Found")

FLAVOURS = st.sampled_from(["ardupilot", "px4"])
COUNTS = st.integers(1, MOST_ID)


def asked(**options: object) -> Request:
    return checked(Options(**options))  # type: ignore[arg-type]


def attempt(what: Callable[[], Found]) -> Found | InputError:
    try:
        return what()
    except InputError as error:
        return error


# Ports


def test_ardupilot_is_where_its_sitl_is() -> None:
    third = addresses("ardupilot", 5, None, "127.0.0.1", ())[2]
    assert third.endpoints == tuple(TcpIn("127.0.0.1", port) for port in (5780, 5782, 5783))
    assert third.pymavlink == "tcp:127.0.0.1:5780"
    assert third.mavsdk == "tcpout://127.0.0.1:5780"


def test_px4_is_where_its_sitl_is() -> None:
    every = addresses("px4", 12, None, "127.0.0.1", ())
    assert every[2].endpoints == (
        UdpIn("127.0.0.1", 14582, ("127.0.0.1", 14542)),
        UdpIn("127.0.0.1", 18572, ("127.0.0.1", 14550)),
    )
    assert every[2].pymavlink == "udpin:127.0.0.1:14542"
    assert every[2].mavsdk == "udpin://127.0.0.1:14542"
    # As PX4 does from the tenth instance on.
    assert {address.pymavlink for address in every[9:]} == {"udpin:127.0.0.1:14549"}


@pytest.mark.parametrize("host", ["::", "::1"])
def test_ipv6_is_answered_by_ipv6(host: str) -> None:
    assert addresses("ardupilot", 1, None, host, ())[0].pymavlink == "tcp:[::1]:5760"
    px4 = addresses("px4", 1, None, host, ())[0]
    assert px4.endpoints[0] == UdpIn(host, 14580, ("::1", 14540))
    assert px4.mavsdk == "udpin://[::1]:14540"


@given(FLAVOURS, COUNTS, st.none() | st.integers(1, 65535))
def test_no_two_vehicles_listen_at_one_port(flavour: str, count: int, base: int | None) -> None:
    every = attempt(lambda: addresses(flavour, count, base, "127.0.0.1", ()))  # type: ignore[arg-type]
    if isinstance(every, InputError):
        assert "allowed is 65535" in str(every)
        assert base is not None
        return
    assert len(every) == count
    listening = [one for address in every for one in address.endpoints if isinstance(one, UdpIn | TcpIn)]
    ports = [one.port for one in listening]
    peers = {one.peer[1] for one in listening if isinstance(one, UdpIn) and one.peer is not None}
    assert len(set(ports)) == len(ports) == len([one for address in every for one in address.endpoints])
    assert max(ports) <= 65535
    # Nor where a client is to listen.
    assert not peers & set(ports)
    for endpoint in listening:
        assert parse_endpoint(str(endpoint)) == endpoint


@given(FLAVOURS, st.integers(1, 200))
def test_another_base_moves_all_ports_alike(flavour: str, count: int) -> None:
    usual, moved = (addresses(flavour, count, base, "::1", ()) for base in (None, 30_000))  # type: ignore[arg-type]
    shifts = {
        new.port - old.port
        for before, after in zip(usual, moved, strict=True)
        for old, new in zip(before.endpoints, after.endpoints, strict=True)
        if isinstance(old, UdpIn | TcpIn) and isinstance(new, UdpIn | TcpIn)
    }
    assert len(shifts) == 1


def test_what_all_share_is_added_to_each() -> None:
    shared = extra("udpout:127.0.0.1:14550", 3), extra("mcast:", 3)
    for address in addresses("ardupilot", 3, None, "127.0.0.1", shared):
        assert address.endpoints[3:] == (UdpOut("127.0.0.1", 14550), Multicast())


@pytest.mark.parametrize("text", ["udpin:127.0.0.1:9", "tcpin:127.0.0.1:9", "/dev/ttyS0,57600"])
def test_what_only_one_can_have_is_for_one(text: str) -> None:
    assert extra(text, 1) == parse_endpoint(text)
    with pytest.raises(InputError, match=r"only one vehicle can have that; several share udpout"):
        extra(text, 2)


def test_a_log_is_no_place_to_fly_to() -> None:
    with pytest.raises(InputError, match="a log hears nothing"):
        extra("tlog:x.tlog", 1)


@pytest.mark.parametrize(
    ("text", "open_to_others"),
    [
        ("tcpin:127.0.0.1:5760", False),
        ("udpin:[::1]:14580", False),
        ("udpout:localhost:14550", False),
        ("mcast:,127.0.0.1", False),
        ("/dev/ttyS0,57600", False),
        ("tcpin:0.0.0.0:5760", True),
        ("udpin:192.168.1.5:14580", True),
        ("udpout:ground:14550", True),
        ("udpout:[fe80::1%eth0]:14550", True),
        ("mcast:", True),
    ],
)
def test_who_can_be_reached_from_outside_is_known(text: str, open_to_others: bool) -> None:
    assert exposed(parse_endpoint(text)) == open_to_others


# Options


def test_all_that_is_wrong_is_said_at_once() -> None:
    with pytest.raises(InputError) as caught:
        asked(
            count=9,
            first_id=250,
            flavour="inav",
            sensors="none",
            physics="gazebo",
            startup="slow",
            origin="47,8,1,2",
            spacing=math.nan,
            speedup=math.inf,
        )
    lines = str(caught.value).split("\n")
    for name in ("flavour", "sensors", "physics", "startup", "spacing", "speedup", "count", "origin"):
        (line,) = [line for line in lines if line.startswith(f"--{name} ")]
        assert "allowed" in line


@given(st.one_of(st.text(max_size=20), st.lists(st.floats().map(str), max_size=4).map(",".join)))
@settings(max_examples=300)
def test_any_text_is_an_origin_or_refused(text: str) -> None:
    origin = attempt(lambda: asked(origin=text).origin)
    if isinstance(origin, InputError):
        assert str(origin).startswith("--origin ")
        assert "allowed is LATITUDE,LONGITUDE[,ALTITUDE]" in str(origin)
        return
    numbers = [float(part) for part in text.split(",")]
    assert [origin.latitude, origin.longitude, origin.altitude][: len(numbers)] == numbers
    assert Origin.model_validate(origin.model_dump()) == origin


@pytest.mark.parametrize("count", [1, 2, 5, 50])
def test_vehicles_stand_at_least_the_spacing_apart_and_close_together(count: int) -> None:
    request = asked(count=count, spacing=4.0)
    places = [np.array(request.place(index)) for index in range(count)]
    assert places[0].tolist() == [0.0, 0.0, 0.0]
    gaps = [float(np.linalg.norm(a - b)) for a, b in combinations(places, 2)]
    assert min(gaps, default=4.0) == pytest.approx(4.0)
    assert max(gaps, default=0.0) <= 4.0 * math.sqrt(2 * count)


@pytest.mark.parametrize("count", [1, 5, 8])
def test_as_many_columns_as_vehicles_are_a_row_towards_the_east(count: int) -> None:
    request = asked(count=count, columns=count, spacing=5.0)
    assert [request.place(index) for index in range(count)] == [(5.0 * k, 0.0, 0.0) for k in range(count)]


def test_a_vehicle_is_what_was_asked_for() -> None:
    request = asked(
        count=3, first_id=7, flavour="px4", vehicle="hummingbird", sensors="rtk", startup="realistic"
    )
    node = request.autopilot(2, 1_700_000_000_000_000, Saved())
    config = node.config
    assert (config.system_id, config.flavour, config.sensors) == (9, "px4", "rtk")
    assert (config.streams, config.startup, config.epoch) == ("normal", "in stages", 1_700_000_000_000_000)
    assert 20.0 <= config.ready_after <= 40.0
    assert config.battery is not None
    here = request.frame.to_enu(config.latitude, config.longitude, config.altitude)
    assert here == pytest.approx(request.place(2), abs=1e-3)
    assert asked().autopilot(0, 0, Saved()).config.ready_after <= 1.0


# Work


@given(COUNTS, st.floats(0.01, 1000.0), st.integers(1, 64))
def test_every_vehicle_is_in_one_squad_and_squads_are_alike(count: int, speed: float, most: int) -> None:
    found = groups(count, speed, most)
    assert sorted(index for group in found for index in group) == list(range(count))
    assert 1 <= len(found) <= most
    sizes = [len(group) for group in found]
    assert max(sizes) - min(sizes) <= 1


@given(st.floats(0.01, 1000.0))
def test_steps_fit_the_clocks_grid_and_the_physics(speed: float) -> None:
    assert period(speed) % 2500 == 0
    assert 2500 <= period(speed) <= 50_000
    # No answer takes longer than 10 ms of the wall, unless it is a grid's step of slow motion.
    assert period(speed) / speed <= PERIOD or period(speed) == 2500
    # A millisecond of the wall, as long as telemetry at 20 Hz keeps its rate.
    assert period(speed) / speed >= 750.0 or period(speed) == 50_000
    assert period(1.0) == PERIOD


def test_a_camera_is_a_shipped_name_or_a_file() -> None:
    assert asked().camera is None
    assert asked(camera="walker").target() is not None
    with pytest.raises(InputError, match="neither a file nor a shipped name; cameras are walker"):
        asked(camera="walkr")


def test_the_tracked_object_has_an_id_that_no_vehicle_has() -> None:
    for count, first in ((1, 1), (254, 1), (1, 254)):
        request = asked(count=count, first_id=first, camera="walker")
        assert request.target_system not in request.systems
