"""Endpoints of links, as text and as values; nothing is opened or looked up here.

The forms are those of pymavlink and MAVProxy; ``//`` after the colon, as MAVSDK writes it, is allowed::

    udpin:HOST:PORT        listen; send to recent senders         tcp:HOST:PORT      connect, again and again
    udpout:HOST:PORT       send first                             tcpin:HOST:PORT    accept connections
    udpin:HOST:PORT,HOST:PORT    listen, and always send to the second address, too
    mcast:[GROUP[:PORT]][,INTERFACE]                              /dev/DEVICE,BAUD   serial port
    tlog:PATH              frames of a log, with their recorded timing

HOST is a name, an IPv4 address, or an IPv6 address in brackets. INTERFACE is the IPv4 address of an interface
of this machine; with a loopback address (127.0.0.1) multicast stays on this machine.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import AddressValueError, IPv4Address, IPv6Address
from typing import Final

from mavlink_bridge.errors import EndpointError

MULTICAST_GROUP: Final = "239.255.145.50"
"""MAVLink's group, of the organisation-local range (RFC 2365)."""
MULTICAST_PORT: Final = 14550
BAUD_RATES: Final = (
    *(1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 576000, 921600),
    *(1000000, 1152000, 1500000, 2000000, 2500000, 3000000, 3500000, 4000000),
)
"""Bit/s that a serial port may have; not every system supports all."""

_FORMS: Final = (
    "udpin:HOST:PORT, udpout:HOST:PORT, mcast:GROUP:PORT, tcp:HOST:PORT, tcpin:HOST:PORT, "
    "/dev/DEVICE,BAUD or tlog:PATH"
)
_HOST_NAME = re.compile(r"[A-Za-z0-9_](?:[A-Za-z0-9_.-]{0,251}[A-Za-z0-9_.])?")
_IPV6 = re.compile(r"[0-9A-Fa-f:.]+(?:%[A-Za-z0-9_.-]{1,32})?")
_NUMBER = re.compile(r"[0-9]{1,9}")
_MAX_SHOWN = 100


def _address(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


@dataclass(frozen=True, slots=True)
class UdpIn:
    """UDP socket bound to ``host``, ``port`` (0: the system chooses a free one).

    ``peer``: host and port that everything is sent to, even before it has sent anything, as autopilots do
    with a ground station.
    """

    host: str
    port: int
    peer: tuple[str, int] | None = None

    def __str__(self) -> str:
        place = f"udpin:{_address(self.host, self.port)}"
        return place if self.peer is None else f"{place},{_address(*self.peer)}"


@dataclass(frozen=True, slots=True)
class UdpOut:
    """UDP socket that sends to ``host``, ``port``, and receives only from there."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udpout:{_address(self.host, self.port)}"


@dataclass(frozen=True, slots=True)
class Multicast:
    """Multicast group; ``interface``: IPv4 address of the interface, None: the routing table selects one."""

    group: str = MULTICAST_GROUP
    port: int = MULTICAST_PORT
    interface: str | None = None

    def __str__(self) -> str:
        place = f"mcast:{self.group}:{self.port}"
        return place if self.interface is None else f"{place},{self.interface}"


@dataclass(frozen=True, slots=True)
class TcpOut:
    """TCP client of ``host``, ``port``, which reconnects when the connection breaks."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp:{_address(self.host, self.port)}"


@dataclass(frozen=True, slots=True)
class TcpIn:
    """TCP server on ``host``, ``port`` (0: the system chooses a free one)."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcpin:{_address(self.host, self.port)}"


@dataclass(frozen=True, slots=True)
class Serial:
    """Serial port, 8N1, without flow control, at ``baud`` bit/s."""

    device: str
    baud: int

    def __str__(self) -> str:
        return f"{self.device},{self.baud}"


@dataclass(frozen=True, slots=True)
class Replay:
    """Frames of the tlog at ``path``; nothing can be sent."""

    path: str

    def __str__(self) -> str:
        return f"tlog:{self.path}"


Endpoint = UdpIn | UdpOut | Multicast | TcpOut | TcpIn | Serial | Replay


def parse_endpoint(text: str) -> Endpoint:
    """Parse an endpoint; ``parse_endpoint(str(endpoint))`` equals ``endpoint``.

    Raises EndpointError, with one line: the text, the fault, the allowed forms.
    """
    try:
        return _parse(text)
    except _FormError as fault:
        shown = text if len(text) <= _MAX_SHOWN else text[:_MAX_SHOWN] + "…"
        raise EndpointError(f"{shown!r}: {fault}") from None


class _FormError(ValueError):
    """A fault of the text and what is allowed, without the text itself."""


def _parse(text: str) -> Endpoint:
    if text.startswith("/"):
        return _serial(text)
    scheme, colon, rest = text.partition(":")
    if not colon or scheme not in _PARSERS:
        meant = f"; did you mean 'tlog:{text}'?" if text.endswith((".tlog", ".tlog.gz")) else ""
        raise _FormError(f"no endpoint begins with {scheme[:20]!r}; allowed are {_FORMS}{meant}")
    return _PARSERS[scheme](rest)


def _udp_in(rest: str) -> UdpIn:
    place, comma, peer = rest.partition(",")
    host, port = _host_port("udpin", place, lowest=0)
    return UdpIn(host, port, _host_port("udpin:HOST:PORT,HOST:PORT", peer, lowest=1) if comma else None)


def _udp_out(rest: str) -> UdpOut:
    return UdpOut(*_host_port("udpout", rest, lowest=1))


def _tcp_out(rest: str) -> TcpOut:
    return TcpOut(*_host_port("tcp", rest, lowest=1))


def _tcp_in(rest: str) -> TcpIn:
    return TcpIn(*_host_port("tcpin", rest, lowest=0))


def _multicast(rest: str) -> Multicast:
    form = "mcast:GROUP:PORT,INTERFACE (each may be left out)"
    place, comma, interface = rest.removeprefix("//").partition(",")
    group, colon, port = place.partition(":")
    group = group or MULTICAST_GROUP
    try:
        if not IPv4Address(group).is_multicast:
            raise _FormError(f"group {group!r} is outside 224.0.0.0…239.255.255.255; the form is {form}")
    except AddressValueError:
        raise _FormError(f"group {group!r} is no IPv4 address; the form is {form}") from None
    if comma:
        try:
            IPv4Address(interface)
        except AddressValueError:
            raise _FormError(
                f"interface {interface!r} is no IPv4 address (127.0.0.1 stays on this machine); "
                f"the form is {form}"
            ) from None
    number = _port(port, 1, form) if colon else MULTICAST_PORT
    return Multicast(group, number, interface if comma else None)


def _serial(text: str) -> Serial:
    device, comma, baud = text.rpartition(",")
    if not comma:
        raise _FormError(
            "the baud rate is missing; the form is /dev/DEVICE,BAUD, for example /dev/ttyACM0,57600"
        )
    if "\0" in device:
        raise _FormError("the path of the device has a NUL in it; the form is /dev/DEVICE,BAUD")
    if not device.strip("/"):
        raise _FormError(
            "the device is missing; the form is /dev/DEVICE,BAUD, for example /dev/ttyACM0,57600"
        )
    if _NUMBER.fullmatch(baud) is None or int(baud) not in BAUD_RATES:
        raise _FormError(f"baud rate {baud[:20]!r}; allowed are {', '.join(map(str, BAUD_RATES))}")
    return Serial(device, int(baud))


def _replay(rest: str) -> Replay:
    if not rest or "\0" in rest:
        raise _FormError("the path of the log is missing or has a NUL in it; the form is tlog:PATH")
    return Replay(rest)


_PARSERS: Final[dict[str, Callable[[str], Endpoint]]] = {
    "udpin": _udp_in,
    "udpout": _udp_out,
    "mcast": _multicast,
    "tcp": _tcp_out,
    "tcpin": _tcp_in,
    "tlog": _replay,
}


def _host_port(scheme: str, rest: str, lowest: int) -> tuple[str, int]:
    form = scheme if ":" in scheme else f"{scheme}:HOST:PORT"
    host, colon, port = rest.removeprefix("//").rpartition(":")
    if not colon:
        raise _FormError(f"the port is missing; the form is {form}")
    if not host:
        raise _FormError(
            f"the host is missing; the form is {form}"
            + ("" if lowest else ", with 127.0.0.1 for this machine only, 0.0.0.0 for every interface")
        )
    return _host(host, form), _port(port, lowest, form)


def _host(text: str, form: str) -> str:
    if text.startswith("[") and text.endswith("]"):
        try:
            # IPv6Address accepts anything as a zone (%eth0).
            if _IPV6.fullmatch(text[1:-1]) is None:
                raise AddressValueError
            IPv6Address(text[1:-1])
        except AddressValueError:
            raise _FormError(f"host {text[:60]!r} is no IPv6 address; the form is {form}") from None
        return text[1:-1]
    if _HOST_NAME.fullmatch(text) is None:
        raise _FormError(
            f"host {text[:60]!r} is neither a name nor an address (IPv6 in brackets); the form is {form}"
        )
    return text


def _port(text: str, lowest: int, form: str) -> int:
    if _NUMBER.fullmatch(text) is None or not lowest <= int(text) <= 65535:
        raise _FormError(f"port {text[:20]!r} is outside {lowest}…65535; the form is {form}")
    return int(text)
