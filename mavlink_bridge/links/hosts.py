"""Host names to socket addresses, and what the system says when something is wrong, in words."""

from __future__ import annotations

import os
import socket
from typing import Any

from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import Endpoint


def resolved(
    endpoint: Endpoint, host: str, port: int, kind: socket.SocketKind
) -> tuple[socket.AddressFamily, tuple[Any, ...]]:
    """Family and address for ``host``; IPv4 where a name has both, as MAVLink tools listen there.

    May ask a name server, so that it takes its time. Raises LinkError.
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
    """The system's own words for an error number."""
    return os.strerror(error.errno) if error.errno is not None else str(error)
