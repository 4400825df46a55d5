"""Ports of the companions: each message is forwarded to all others, unless the link is cut."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from random import Random
from typing import Final

from trials.plan import HOST

_LONGEST: Final = 65536
_BUFFER: Final = 1 << 20


class CompanionPorts:
    """UDP port for each of ``systems``; the last sender at a port is that vehicle's companion.

    ``loss``: share of the messages to each receiver that is lost, drawn from ``random``.
    """

    def __init__(self, systems: Sequence[int], loss: float = 0.0, random: Random | None = None) -> None:
        self.cut = False
        self._loss, self._random = loss, Random(0) if random is None else random
        self._ports = {system: _bound() for system in systems}
        self._there: dict[int, tuple[str, int]] = {}

    def endpoint(self, system: int) -> str:
        """Return the endpoint for the companion of ``system``."""
        return f"udpout:{HOST}:{self._ports[system].getsockname()[1]}"

    @property
    def sockets(self) -> list[socket.socket]:
        """Sockets that are readable when something has arrived."""
        return list(self._ports.values())

    def turn(self) -> None:
        """Forward everything that has arrived."""
        for system, port in self._ports.items():
            while True:
                try:
                    data, self._there[system] = port.recvfrom(_LONGEST)
                except ConnectionError:
                    continue  # a companion that is gone
                except OSError:
                    break
                if not self.cut:
                    self._pass_on(data, system)

    def close(self) -> None:
        """Close all ports."""
        for port in self._ports.values():
            port.close()

    def _pass_on(self, data: bytes, sender: int) -> None:
        for system, place in self._there.items():
            if system != sender and self._random.random() >= self._loss:
                try:
                    self._ports[system].sendto(data, place)
                except OSError:
                    continue


def _bound() -> socket.socket:
    port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    port.bind((HOST, 0))
    port.setblocking(False)
    port.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
    return port
