"""Links over TCP: a client that reconnects whenever the connection breaks, and a server for several peers."""

from __future__ import annotations

import errno
import os
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
"""Largest number of peers of a listener; further connections are closed at once."""
BACKLOG: Final = 65536
"""Bytes that may wait for one peer: some seconds of a vehicle's telemetry."""
PATIENCE: Final = 5_000_000
"""µs after which a connection attempt is aborted: TCP repeats a lost packet after one and three seconds."""

_PEER_TIMEOUT_S: Final = 30
# TCP_USER_TIMEOUT (ms) limits how long sent data may stay without acknowledgement. The other options end an
# idle connection to a lost peer after 15 s + 3 probes of 5 s.
_TIMEOUT_OPTIONS: Final = {
    "TCP_USER_TIMEOUT": 1000 * _PEER_TIMEOUT_S,
    "TCP_KEEPIDLE": 15,
    "TCP_KEEPINTVL": 5,
    "TCP_KEEPCNT": 3,
}


def _configure(connection: socket.socket) -> None:
    """Configure ``connection`` for low latency and detection of a lost peer.

    Small packets are sent at once, the system's send buffer is small, and where the system supports it, a
    lost peer is detected within half a minute.
    """
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BACKLOG)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in _TIMEOUT_OPTIONS.items():
        option = getattr(socket, name, None)
        if option is not None:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)


class TcpCaller(StreamLink):
    """Link of ``tcp``, which attempts to connect until a peer accepts, at most once a second.

    A missing peer is not an error, because the other side may be started later.
    """

    def __init__(self, endpoint: TcpOut, clock: Clock) -> None:
        # ``resolved`` may raise; therefore it is called before anything is opened.
        self._family, self._address = resolved(endpoint, endpoint.host, endpoint.port, socket.SOCK_STREAM)
        super().__init__(clock, BACKLOG)
        self._attempt: socket.socket | None = None
        self._attempt_began = 0
        self.failure = ""
        """Why the last attempt failed, in the system's words; empty with a peer and before a failure."""
        self.receive()

    def _reopen(self, now: int) -> None:
        if self._attempt is not None and now - self._attempt_began < PATIENCE:
            return
        self._abort_attempt()
        connection = socket.socket(self._family, socket.SOCK_STREAM)
        connection.setblocking(False)
        try:
            connection.connect(self._address)
        except BlockingIOError:
            pass  # the usual case: the socket becomes writable when the attempt succeeds or fails
        except OSError as error:
            self.failure = because(error)
            connection.close()
            return
        self._attempt, self._attempt_began = connection, now
        self._selector.register(connection, selectors.EVENT_WRITE)

    def _attend(self, ready: Any) -> None:
        connection = self._attempt
        if connection is None or ready is not connection:
            return
        # A TCP connection to a free port of this machine may by chance be connected to itself.
        error = connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if error or connection.getsockname() == self._address:
            self.failure = os.strerror(error or errno.ECONNREFUSED)
            self._abort_attempt()
            return
        self.failure = ""
        self._selector.unregister(connection)
        self._attempt = None
        _configure(connection)
        self._adopt(connection.detach())

    def _abort_attempt(self) -> None:
        if self._attempt is not None:
            self._selector.unregister(self._attempt)
            self._attempt.close()
            self._attempt = None

    def _register(self) -> None:
        if self._attempt is not None:
            self._selector.register(self._attempt, selectors.EVENT_WRITE)

    def _release(self) -> None:
        self._abort_attempt()


class TcpListener(StreamLink):
    """Link of ``tcpin``: what is sent goes to every connected peer.

    A peer that takes less than it is sent is read from twice a second only, and one that takes nothing not at
    all: its requests wait in its own system, because their answers would be lost.
    """

    _waits_for_readers = True

    def __init__(self, endpoint: TcpIn, clock: Clock) -> None:
        family, address = resolved(endpoint, endpoint.host, endpoint.port, socket.SOCK_STREAM)
        super().__init__(clock, BACKLOG)
        self._listener = listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            # Without SO_REUSEADDR the port could not be bound for a minute after a restart.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen()
        except OSError as error:
            listener.close()
            self.close()
            raise LinkError(f"{endpoint}: cannot listen there: {because(error)}") from None
        listener.setblocking(False)
        self._selector.register(listener, selectors.EVENT_READ)

    @property
    def address(self) -> tuple[Any, ...]:
        """Local address of the listening socket: host, port, …."""
        address: tuple[Any, ...] = self._listener.getsockname()
        return address

    def _attend(self, ready: Any) -> None:
        if ready is not self._listener:
            return
        with suppress(OSError):  # the peer may have disconnected before accept()
            connection, _ = self._listener.accept()
            if self.peers >= MOST_CALLERS:
                connection.close()
                return
            with connection:
                _configure(connection)
                self._adopt(connection.detach())

    def _register(self) -> None:
        self._selector.register(self._listener, selectors.EVENT_READ)

    def _release(self) -> None:
        self._listener.close()
