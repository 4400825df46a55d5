"""Links over TCP: a client that reconnects whenever the connection breaks, and a server for several peers."""

from __future__ import annotations

import selectors
import socket
from contextlib import suppress
from typing import Any, Final

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.errors import LinkError
from mavlink_bridge.links.endpoints import TcpIn, TcpOut
from mavlink_bridge.links.hosts import because, resolved
from mavlink_bridge.links.streams import StreamLink

MOST_CALLERS: Final = 32
BACKLOG: Final = 65536
"""Bytes; some seconds of a vehicle's telemetry."""
PATIENCE: Final = 5_000_000
"""µs after which a connection attempt ends: a lost packet is repeated after one second and after three."""


_UNHEARD: Final = 30
# s without an answer from the other machine: for data that it has not acknowledged, and for probes when idle.
_WATCH: Final = {
    "TCP_USER_TIMEOUT": 1000 * _UNHEARD,
    "TCP_KEEPIDLE": 15,
    "TCP_KEEPINTVL": 5,
    "TCP_KEEPCNT": 3,
}


def _quick(connection: socket.socket) -> None:
    """Configure ``connection`` for low latency and detection of a lost peer.

    Small packets are sent at once; little waits in the system beside the own backlog; and where the system
    supports it, a lost peer is detected within half a minute.
    """
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BACKLOG)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in _WATCH.items():
        option = getattr(socket, name, None)
        if option is not None:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)


class TcpCaller(StreamLink):
    """Link of ``tcp``: it attempts to connect once a second until a peer accepts.

    A missing peer is no error at first: the other side may be started later.
    """

    def __init__(self, endpoint: TcpOut, clock: Clock) -> None:
        # First, so that a host without address leaves nothing open.
        self._family, self._address = resolved(endpoint, endpoint.host, endpoint.port, socket.SOCK_STREAM)
        super().__init__(clock, BACKLOG)
        self._calling: socket.socket | None = None
        self._called_at = 0
        self.receive()

    def _reopen(self, now: int) -> None:
        if self._calling is not None and now - self._called_at < PATIENCE:
            return
        self._disconnect()
        call = socket.socket(self._family, socket.SOCK_STREAM)
        call.setblocking(False)
        try:
            call.connect(self._address)
        except BlockingIOError:
            pass  # the usual case: the socket becomes writable when the connection is decided
        except OSError:
            call.close()
            return
        self._calling, self._called_at = call, now
        self._selector.register(call, selectors.EVENT_WRITE)

    def _attend(self, ready: Any) -> None:
        call = self._calling
        if call is None or ready is not call:
            return
        # A connection to a free port of this machine may by chance reach itself.
        if call.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) or call.getsockname() == self._address:
            self._disconnect()
            return
        self._selector.unregister(call)
        self._calling = None
        _quick(call)
        self._adopt(call.detach())

    def _disconnect(self) -> None:
        if self._calling is not None:
            self._selector.unregister(self._calling)
            self._calling.close()
            self._calling = None

    def _release(self) -> None:
        self._disconnect()


class TcpListener(StreamLink):
    """Link of ``tcpin``: what is sent goes to every connected peer."""

    def __init__(self, endpoint: TcpIn, clock: Clock) -> None:
        family, address = resolved(endpoint, endpoint.host, endpoint.port, socket.SOCK_STREAM)
        super().__init__(clock, BACKLOG)
        self._door = door = socket.socket(family, socket.SOCK_STREAM)
        try:
            # Without it a restart would have to wait a minute for the port.
            door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            door.bind(address)
            door.listen()
        except OSError as error:
            door.close()
            self.close()
            raise LinkError(f"{endpoint}: cannot listen there: {because(error)}") from None
        door.setblocking(False)
        self._selector.register(door, selectors.EVENT_READ)

    @property
    def address(self) -> tuple[Any, ...]:
        """Local address of the listening socket: host, port, …."""
        address: tuple[Any, ...] = self._door.getsockname()
        return address

    def _attend(self, ready: Any) -> None:
        if ready is not self._door:
            return
        with suppress(OSError):  # the peer may have hung up before accept()
            caller, _ = self._door.accept()
            if self.peers >= MOST_CALLERS:
                caller.close()
                return
            with caller:
                _quick(caller)
                self._adopt(caller.detach())

    def _release(self) -> None:
        self._door.close()
