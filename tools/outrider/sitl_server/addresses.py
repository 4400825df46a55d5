"""Endpoints of each vehicle: the ports of the firmware's own SITL, and additional ones.

ArduPilot's instance i serves TCP at 5760 + 10 i (SERIAL0), 5762 + 10 i and 5763 + 10 i (SERIAL1 and 2). PX4's
instance i binds UDP 14580 + i and sends to 14540 + i (offboard; from the tenth instance on all to 14549, as
PX4 does). It also binds 18570 + i and sends to 14550, the ground station.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from mavlink_bridge.links.endpoints import (
    Endpoint,
    Replay,
    Serial,
    TcpIn,
    TcpOut,
    UdpIn,
    parse_endpoint,
)
from outrider.errors import InputError
from outrider.sitl_server.request import FlavourName

PORT_BASE: Final[dict[FlavourName, int]] = {"ardupilot": 5760, "px4": 14540}
_ANY_ADDRESS: Final = ("0.0.0.0", "::")
_LAST_PORT: Final = 65535
_PORT_OFFSETS: Final = (0, 2, 3)
_PORTS_PER_INSTANCE: Final = 10
_OFFBOARD_PORTS: Final = 10
# Offsets from PX4's base port of 14540.
_OWN, _GROUND_STATION, _OWN_FOR_GROUND_STATION = 40, 10, 4030


class Address(NamedTuple):
    """Endpoints of one vehicle.

    ``pymavlink`` and ``mavsdk`` are the connection strings of the first endpoint for pymavlink and MAVProxy,
    and for MAVSDK.
    """

    endpoints: tuple[Endpoint, ...]
    pymavlink: str
    mavsdk: str


def addresses(
    flavour: FlavourName, count: int, base: int | None, host: str, more: tuple[Endpoint, ...]
) -> list[Address]:
    """Return the addresses of ``count`` vehicles, from port ``base`` on (None: the firmware's own).

    They listen at ``host``. ``more``: endpoints that every vehicle opens in addition. Raises InputError if
    ports run out.
    """
    start = PORT_BASE[flavour] if base is None else base
    of = _ardupilot if flavour == "ardupilot" else _px4
    found = [of(start, index, host, more) for index in range(count)]
    last = max(one.port for address in found for one in address.endpoints if isinstance(one, UdpIn | TcpIn))
    if last > _LAST_PORT:
        raise InputError(f"--port-base {start}: ports would go up to {last}; allowed is {_LAST_PORT}")
    return found


def extra(text: str, count: int) -> Endpoint:
    """Parse an endpoint of ``--to``.

    Raises EndpointError, and InputError for a log and for an endpoint that only one of several vehicles could
    open.
    """
    endpoint = parse_endpoint(text)
    if isinstance(endpoint, Replay):
        raise InputError(
            f"--to {text}: a log hears nothing; allowed: udpout, tcp, mcast, udpin, tcpin, /dev/…"
        )
    if isinstance(endpoint, UdpIn | TcpIn | Serial) and count > 1:
        raise InputError(
            f"--to {text}: only one vehicle can have that; several share udpout:HOST:PORT, tcp:HOST:PORT "
            "or mcast:"
        )
    return endpoint


def _ardupilot(base: int, index: int, host: str, more: tuple[Endpoint, ...]) -> Address:
    first = base + _PORTS_PER_INSTANCE * index
    ports = tuple(TcpIn(host, first + serial) for serial in _PORT_OFFSETS)
    to = str(TcpOut(_here(host) if host in _ANY_ADDRESS else host, first))
    return Address((*ports, *more), to, to.replace("tcp:", "tcpout://", 1))


def _px4(base: int, index: int, host: str, more: tuple[Endpoint, ...]) -> Address:
    offboard = base + min(index, _OFFBOARD_PORTS - 1)
    here = _here(host)
    ports = (
        UdpIn(host, base + _OWN + index, (here, offboard)),
        UdpIn(host, base + _OWN_FOR_GROUND_STATION + index, (here, base + _GROUND_STATION)),
    )
    to = str(UdpIn(here, offboard))
    return Address((*ports, *more), to, to.replace("udpin:", "udpin://", 1))


def _here(host: str) -> str:
    """Return this machine's loopback address, of the same protocol as ``host``."""
    return "::1" if ":" in host else "127.0.0.1"
