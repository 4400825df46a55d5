"""Where an observer hears vehicles that are not the emulation's: a link to one, or one port to which many
speak."""

from __future__ import annotations

import socket
from typing import Final, Protocol

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import UdpIn, parse_endpoint
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.wire.framing import Flaw, frame_at
from outrider.errors import InputError

_LONGEST: Final = 65536
_BUFFER: Final = 1 << 20
_AUTOPILOT: Final = 1
"""MAV_COMP_ID."""


class Ear(Protocol):
    """Hears some vehicles, and asks them."""

    def receive(self) -> list[bytes]:
        """What has come."""
        ...

    def tell(self, system: int, data: bytes) -> None:
        """To that vehicle, if it is known where it is."""
        ...

    def close(self) -> None:
        """Give everything back."""
        ...


class LinkEar:
    """An endpoint at which one vehicle is."""

    def __init__(self, endpoint: str) -> None:
        self._link = open_link(endpoint, WallClock())

    def receive(self) -> list[bytes]:
        """What has come."""
        return self._link.receive()

    def tell(self, system: int, data: bytes) -> None:
        """To it."""
        self._link.send(data)

    def close(self) -> None:
        """Its link."""
        self._link.close()


class PortEar:
    """A UDP port to which several vehicles speak as to a ground station. Each is told only what is for it:
    a PX4 passes on to its companion what it hears here."""

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
        """Where it listens."""
        host, port = self._port.getsockname()
        return host, port

    def receive(self) -> list[bytes]:
        """What has come."""
        found: list[bytes] = []
        while True:
            try:
                data, place = self._port.recvfrom(_LONGEST)
            except ConnectionError:
                continue  # one that is gone
            except OSError:
                return found
            frame = frame_at(data, 0)
            # It passes on what others say, too.
            if not isinstance(frame, Flaw) and frame.component == _AUTOPILOT:
                self._there[frame.system] = place
            found.append(data)

    def tell(self, system: int, data: bytes) -> None:
        """To where it was heard last."""
        place = self._there.get(system)
        if place is not None:
            try:
                self._port.sendto(data, place)
            except OSError:
                return

    def close(self) -> None:
        """The port."""
        self._port.close()


def open_ears(told: dict[int, str]) -> dict[int, Ear]:
    """For each vehicle, by the endpoint where it is heard: one ear for all that share one."""
    ears: dict[str, Ear] = {}
    try:
        for text in told.values():
            if text not in ears:
                endpoint = parse_endpoint(text)
                # With a peer it is one vehicle's.
                shared = isinstance(endpoint, UdpIn) and endpoint.peer is None
                ears[text] = PortEar(endpoint) if shared and isinstance(endpoint, UdpIn) else LinkEar(text)
    except (InputError, LinkError) as error:
        for ear in ears.values():
            ear.close()
        raise error if isinstance(error, InputError) else InputError(f"--autopilots: {error}") from None
    return {system: ears[text] for system, text in told.items()}
