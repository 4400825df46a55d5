"""Address scope of endpoints: whether they reach beyond this machine."""

from __future__ import annotations

from ipaddress import ip_address

from mavlink_bridge.links.endpoints import Endpoint, Multicast, TcpIn, TcpOut, UdpIn, UdpOut


def exposed(endpoint: Endpoint) -> bool:
    """Return whether other machines can reach the endpoint or receive its data; False for serial and logs.

    A host name other than ``localhost`` counts as another machine.
    """
    match endpoint:
        case UdpIn() | TcpIn() | UdpOut() | TcpOut():
            return not _loopback(endpoint.host)
        case Multicast():
            return endpoint.interface is None or not _loopback(endpoint.interface)
    return False


def _loopback(host: str) -> bool:
    try:
        return ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return host == "localhost"
