"""Opening of a link to an endpoint."""

from __future__ import annotations

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.endpoints import (
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
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.replay import ReplayLink
from mavlink_bridge.links.serial_port import SerialPort
from mavlink_bridge.links.tcp import TcpCaller, TcpListener
from mavlink_bridge.links.udp import MulticastLink, UdpCaller, UdpListener


def open_link(endpoint: Endpoint | str, clock: Clock) -> Link:
    """Open the link to ``endpoint``; ``clock`` times reconnections, replays and the removal of silent peers.

    Raises EndpointError for a text that is no endpoint, LinkError (LogError for a log) if the endpoint cannot
    be opened.
    """
    match parse_endpoint(endpoint) if isinstance(endpoint, str) else endpoint:
        case UdpIn() as place:
            return UdpListener(place, clock)
        case UdpOut() as place:
            return UdpCaller(place)
        case Multicast() as place:
            return MulticastLink(place)
        case TcpOut() as place:
            return TcpCaller(place, clock)
        case TcpIn() as place:
            return TcpListener(place, clock)
        case Serial() as place:
            return SerialPort(place, clock)
        case Replay() as place:
            return ReplayLink(place, clock)
