"""Buffer of the datagrams that arrive on all links of a node until the node is due."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from threading import Event, Lock, Thread
from typing import Final

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.tcp import TcpCaller, TcpListener
from mavlink_bridge.node import Datagram

CAPACITY: Final = 4096
"""Largest number of datagrams that wait, for each link."""
ROOM: Final = 1 << 20
"""Largest number of bytes that wait, for each link."""
MAX_STEP_BYTES: Final = 16384
"""Largest number of bytes of each link that one step receives.

A single longer datagram is still received. A node parses this amount in a few milliseconds even if all of it
is garbage; a busy swarm sends a tenth of it in that time.
"""
MAX_STEP_DATAGRAMS: Final = 256
"""Largest number of datagrams of each link that one step receives."""
_READ_INTERVAL_S: Final = 0.02
"""No link fills the system's receive buffer in this time, not even a fast serial port."""


class Inbox:
    """Receive queues of several links, one for each.

    ``links``: pairs of the node's name for a link, and the link. ``take`` reads the links. If any link has a
    file descriptor, a thread also reads all of them every 20 ms, because the system's buffers are small and a
    step may be long. The thread does not wake for every datagram: on a small computer that would take CPU
    time from the steps of all nodes.

    A flood on one link does not affect the others, because each link has a queue of its own. If more than
    ``capacity`` datagrams wait in a queue, or more than ``ROOM`` bytes, the oldest are dropped and counted in
    ``overruns``. A TCP link is not read while ``MAX_STEP_BYTES`` bytes wait, which throttles its sender.
    """

    def __init__(self, links: Sequence[tuple[str, Link]], capacity: int = CAPACITY) -> None:
        self._queues = tuple(_Queue(name, link, capacity) for name, link in links)
        # Only its holder reads the links: two concurrent readers would mix up the order of arrival.
        self._reading = Lock()
        self._closing = Event()
        self._thread = None
        if any(link.fileno() is not None for _, link in links):
            self._thread = Thread(target=self._read_periodically, name="inbox", daemon=True)
            self._thread.start()

    @property
    def overruns(self) -> int:
        """Number of datagrams that were dropped because too many waited."""
        return sum(queue.overruns for queue in self._queues)

    def take(self) -> list[Datagram]:
        """Remove and return what has arrived, by link and in order of arrival, up to the limit of each link.

        The rest waits. Raises BridgeError if the thread has ended by an error.
        """
        if self._thread is not None and not self._thread.is_alive():
            raise BridgeError("the receiving thread has ended")
        with self._reading:
            self._read()
            return [datagram for queue in self._queues for datagram in queue.pop_batch()]

    def close(self) -> None:
        """End the thread and wait for it; the links stay open. Calling it again is harmless."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _read(self) -> None:
        for queue in self._queues:
            queue.read()

    def _read_periodically(self) -> None:
        while not self._closing.wait(_READ_INTERVAL_S):
            with self._reading:
                self._read()


class _Queue:
    """Waiting datagrams of one link, oldest first."""

    def __init__(self, name: str, link: Link, capacity: int) -> None:
        self.overruns = 0
        self._name, self._link, self._capacity = name, link, capacity
        self._throttles = isinstance(link, TcpCaller | TcpListener)
        self._waiting: deque[Datagram] = deque()
        self._bytes = 0

    def read(self) -> None:
        """Read the link; skip a TCP link for which enough data for a step waits already."""
        if self._throttles and self._bytes >= MAX_STEP_BYTES:
            return
        for data in self._link.receive():
            self._waiting.append(Datagram(self._name, data))
            self._bytes += len(data)
        while len(self._waiting) > self._capacity or self._bytes > ROOM:
            self._pop()
            self.overruns += 1

    def pop_batch(self) -> list[Datagram]:
        """Remove and return the oldest datagrams within the limits of one step, but at least one if any."""
        found: list[Datagram] = []
        room = MAX_STEP_BYTES
        while (
            self._waiting
            and len(found) < MAX_STEP_DATAGRAMS
            and (len(self._waiting[0].data) <= room or not found)
        ):
            found.append(self._pop())
            room -= len(found[-1].data)
        return found

    def _pop(self) -> Datagram:
        datagram = self._waiting.popleft()
        self._bytes -= len(datagram.data)
        return datagram
