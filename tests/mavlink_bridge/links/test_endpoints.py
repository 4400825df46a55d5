"""Texts become endpoints and come back; every other text is refused in one line that helps."""

from __future__ import annotations

import string

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mavlink_bridge.errors import EndpointError
from mavlink_bridge.links.endpoints import (
    BAUD_RATES,
    Endpoint,
    Multicast,
    Replay,
    Serial,
    TcpIn,
    TcpOut,
    UdpIn,
    UdpOut,
    parse_endpoint,
)

KINDS = (UdpIn, UdpOut, Multicast, TcpOut, TcpIn, Serial, Replay)


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("udpin:0.0.0.0:14550", UdpIn("0.0.0.0", 14550)),
        ("udpin:127.0.0.1:0", UdpIn("127.0.0.1", 0)),
        ("udpin://localhost:14540", UdpIn("localhost", 14540)),
        ("udpin:127.0.0.1:14580,127.0.0.1:14540", UdpIn("127.0.0.1", 14580, ("127.0.0.1", 14540))),
        ("udpin:[::1]:0,[::1]:9", UdpIn("::1", 0, ("::1", 9))),
        ("udpout:192.168.1.7:14550", UdpOut("192.168.1.7", 14550)),
        ("udpout:[fe80::1%eth0]:14550", UdpOut("fe80::1%eth0", 14550)),
        ("tcp:drone-7.local:5760", TcpOut("drone-7.local", 5760)),
        ("tcpin:[::1]:0", TcpIn("::1", 0)),
        ("mcast:", Multicast("239.255.145.50", 14550, None)),
        ("mcast:239.1.2.3", Multicast("239.1.2.3", 14550, None)),
        ("mcast::14600", Multicast("239.255.145.50", 14600, None)),
        ("mcast:239.1.2.3:99,127.0.0.1", Multicast("239.1.2.3", 99, "127.0.0.1")),
        ("mcast:,10.0.0.4", Multicast("239.255.145.50", 14550, "10.0.0.4")),
        ("/dev/ttyACM0,57600", Serial("/dev/ttyACM0", 57600)),
        ("/dev/serial/by-id/usb-3,D_R,0,921600", Serial("/dev/serial/by-id/usb-3,D_R,0", 921600)),
        ("tlog:flights/a b:c,d.tlog.gz", Replay("flights/a b:c,d.tlog.gz")),
    ],
)
def test_the_forms(text: str, endpoint: Endpoint) -> None:
    assert parse_endpoint(text) == endpoint
    assert parse_endpoint(str(endpoint)) == endpoint


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "allowed are udpin:HOST:PORT"),
        ("udp:127.0.0.1:14550", "no endpoint begins with 'udp'"),
        ("logs/a.tlog", "did you mean 'tlog:logs/a.tlog'"),
        ("14550", "allowed are"),
        ("COM3,57600", "allowed are"),
        ("udpin:127.0.0.1", "the port is missing"),
        ("udpin::14550", "127.0.0.1 for this machine only"),
        ("udpin:127.0.0.1:65536", "port '65536' is outside 0…65535"),
        ("udpin:127.0.0.1:1,", "the form is udpin:HOST:PORT,HOST:PORT"),
        ("udpin:127.0.0.1:1,127.0.0.1:0", "port '0' is outside 1…65535"),
        ("udpin:127.0.0.1:1,127.0.0.1:2,127.0.0.1:3", "host '127.0.0.1:2,127.0.0.1' is neither"),
        ("udpout:127.0.0.1:0", "port '0' is outside 1…65535"),
        ("udpout:127.0.0.1:1_0", "port '1_0'"),
        ("tcp:127.0.0.1:-1", "port '-1'"),
        ("tcp:a b:1", "host 'a b' is neither"),
        ("tcp:::1:5760", "IPv6 in brackets"),
        ("tcpin:[127.0.0.1]:5760", "no IPv6 address"),
        ("tcp:[fe80::1%\n]:5760", "no IPv6 address"),
        ("mcast:10.0.0.1:14550", "224.0.0.0…239.255.255.255"),
        ("mcast:group:14550", "no IPv4 address"),
        ("mcast:239.1.2.3:0", "outside 1…65535"),
        ("mcast:,lo", "127.0.0.1 stays on this machine"),
        ("/dev/ttyACM0", "the baud rate is missing"),
        ("/dev/ttyACM0,", "allowed are 1200"),
        ("/dev/ttyACM0,57601", "57600"),
        ("/,57600", "the device is missing"),
        ("tlog:", "tlog:PATH"),
    ],
)
def test_what_is_wrong_is_said_with_what_is_allowed(text: str, said: str) -> None:
    with pytest.raises(EndpointError) as caught:
        parse_endpoint(text)
    message = str(caught.value)
    assert said in message
    assert message.startswith(repr(text))
    assert "\n" not in message


PIECES = st.sampled_from(
    [
        *(
            "udpin",
            "udpout",
            "mcast",
            "tcp",
            "tcpin",
            "tlog",
            "/dev/x",
            "//",
            "://",
            "127.0.0.1",
            "239.1.1.1",
        ),
        *("[::1]", "[", "]", ":", ",", "%", "14550", "0", "57600", "-1", "٣", "\0", "\n", " ", "é", "\ud800"),
    ]
)


@given(st.one_of(st.text(max_size=60), st.lists(PIECES, max_size=9).map("".join)))
@settings(max_examples=1000)
@example("udpin:" + "a" * 5000 + ":1")
@example("udpin:h:" + "9" * 5000)
def test_any_text_is_an_endpoint_or_refused(text: str) -> None:
    answer = attempt(text)
    if isinstance(answer, EndpointError):
        assert len(str(answer)) < 1000
        assert str(answer).isprintable()
    else:
        assert isinstance(answer, KINDS)
        assert parse_endpoint(str(answer)) == answer


def attempt(text: str) -> Endpoint | EndpointError:
    try:
        return parse_endpoint(text)
    except EndpointError as error:
        return error


HOSTS = st.one_of(
    st.ip_addresses().map(str), st.text(string.ascii_letters + string.digits, min_size=1, max_size=20)
)
GROUPS = st.ip_addresses(v=4, network="224.0.0.0/4").map(str)
INTERFACES = st.none() | st.ip_addresses(v=4).map(str)
ENDPOINTS = st.one_of(
    st.builds(UdpIn, HOSTS, st.integers(0, 65535)),
    st.builds(UdpIn, HOSTS, st.integers(0, 65535), st.tuples(HOSTS, st.integers(1, 65535))),
    st.builds(UdpOut, HOSTS, st.integers(1, 65535)),
    st.builds(TcpOut, HOSTS, st.integers(1, 65535)),
    st.builds(TcpIn, HOSTS, st.integers(0, 65535)),
    st.builds(Multicast, GROUPS, st.integers(1, 65535), INTERFACES),
    st.builds(Serial, st.just("/dev/ttyUSB0"), st.sampled_from(BAUD_RATES)),
    st.builds(Replay, st.text(min_size=1).filter(lambda path: "\0" not in path)),
)


@given(ENDPOINTS)
def test_every_endpoint_can_be_written_and_read(endpoint: Endpoint) -> None:
    assert parse_endpoint(str(endpoint)) == endpoint
