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
    """Return family and address for ``host``.

    IPv4 is preferred where a name has both, because MAVLink tools listen there. The call may query a name
    server and block meanwhile. Raises LinkError.
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
    """Return the system's text for an error number."""
    return os.strerror(error.errno) if error.errno is not None else str(error)
