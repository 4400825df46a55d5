"""Resolution of host names to socket addresses, and error texts of the system."""

from __future__ import annotations

import os
import socket
from typing import Any

from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import Endpoint


def resolved(
    endpoint: Endpoint, host: str, port: int, kind: socket.SocketKind
) -> tuple[socket.AddressFamily, tuple[Any, ...]]:
    """Return address family and socket address of ``host`` and ``port``.

    IPv4 is preferred if a name has addresses of both families, because MAVLink tools listen there. The call
    blocks while it queries a name server. Raises LinkError if there is no address.
    """
    try:
        found = socket.getaddrinfo(host, port, type=kind)
    except (socket.gaierror, UnicodeError) as error:
        reason = error.strerror if isinstance(error, socket.gaierror) else "not a name"
        raise LinkError(f"{endpoint}: host {host!r} has no address: {reason}") from None
    found.sort(key=lambda entry: entry[0] != socket.AF_INET)
    family, _, _, _, address = found[0]
    return family, address


def because(error: OSError) -> str:
    """Return the system's text for the number of ``error``."""
    return os.strerror(error.errno) if error.errno is not None else str(error)
