"""Receivers of an observer for real firmware: a link to one vehicle, or a port to which several send."""

from __future__ import annotations

import socket
from typing import Final, Protocol

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import UdpIn, parse_endpoint
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.wire.framing import Flaw, frame_at
from outrider.errors import InputError

_LONGEST: Final = 65536
_BUFFER: Final = 1 << 20


class Receiver(Protocol):
    """Receiver for some vehicles, which can also send to them."""

    def fileno(self) -> int | None:
        """Return the file descriptor that is readable when something has arrived; None without one."""
        ...

    def receive(self) -> list[bytes]:
        """Return the datagrams received since the last call."""
        ...

    def tell(self, system: int, data: bytes) -> None:
        """Send ``data`` to vehicle ``system``, if its address is known."""
        ...

    def close(self) -> None:
        """Release all resources."""
        ...


class LinkReceiver:
    """Receiver at the endpoint of one vehicle."""

    def __init__(self, endpoint: str) -> None:
        self._link = open_link(endpoint, WallClock())

    def fileno(self) -> int | None:
        """Return the file descriptor of the link."""
        return self._link.fileno()

    def receive(self) -> list[bytes]:
        """Return the datagrams received since the last call."""
        return self._link.receive()

    def tell(self, system: int, data: bytes) -> None:
        """Send ``data`` to the vehicle."""
        self._link.send(data)

    def close(self) -> None:
        """Close the link."""
        self._link.close()


class PortReceiver:
    """UDP port to which several vehicles send as to a ground station.

    Each vehicle is sent only messages addressed to it, because a PX4 forwards to its companion what it
    receives here.
    """

    def __init__(self, endpoint: UdpIn) -> None:
        self._there: dict[int, tuple[str, int]] = {}
        self._port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._port.bind((endpoint.host, endpoint.port))
        except OSError as error:
            self._port.close()
            raise InputError(
                f"{endpoint}, where the vehicles' truth is heard: {error.strerror}. End the ground station"
                " that listens there, or name another endpoint behind an @"
            ) from None
        self._port.setblocking(False)
        self._port.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)

    @property
    def address(self) -> tuple[str, int]:
        """Host and port on which it listens."""
        host, port = self._port.getsockname()
        return host, port

    def fileno(self) -> int | None:
        """Return the file descriptor of the port."""
        return self._port.fileno()

    def receive(self) -> list[bytes]:
        """Return the datagrams received since the last call."""
        found: list[bytes] = []
        while True:
            try:
                data, place = self._port.recvfrom(_LONGEST)
            except ConnectionError:
                continue  # the sender of an earlier datagram is gone
            except OSError:
                return found
            frame = frame_at(data, 0)
            # A PX4 forwards messages of other components, too.
            if not isinstance(frame, Flaw) and frame.component == mavlink.MAV_COMP_ID_AUTOPILOT1:
                self._there[frame.system] = place
            found.append(data)

    def tell(self, system: int, data: bytes) -> None:
        """Send ``data`` to the address from which the vehicle was last received."""
        place = self._there.get(system)
        if place is not None:
            try:
                self._port.sendto(data, place)
            except OSError:
                return

    def close(self) -> None:
        """Close the port."""
        self._port.close()


def open_receivers(told: dict[int, str]) -> dict[int, Receiver]:
    """Open a receiver for each vehicle by its endpoint; vehicles with the same endpoint share one.

    Raises InputError if one cannot be opened; then none stays open.
    """
    receivers: dict[str, Receiver] = {}
    try:
        for text in told.values():
            if text not in receivers:
                endpoint = parse_endpoint(text)
                # With a peer the port is one vehicle's.
                shared = isinstance(endpoint, UdpIn) and endpoint.peer is None
                receivers[text] = (
                    PortReceiver(endpoint) if shared and isinstance(endpoint, UdpIn) else LinkReceiver(text)
                )
    except (InputError, LinkError) as error:
        for receiver in receivers.values():
            receiver.close()
        raise error if isinstance(error, InputError) else InputError(f"--autopilots: {error}") from None
    return {system: receivers[text] for system, text in told.items()}
