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
HANDFUL: Final = 16384
"""Largest number of bytes of each link that one step receives.

A node parses this amount in some milliseconds even in the worst case of garbage; it is ten times what a busy
swarm sends in that time.
"""
FINGERS: Final = 256
"""Largest number of datagrams of each link that one step receives."""
_ROUND: Final = 0.02
# s; no link fills the system's receive buffer in this time, not even a fast serial port.


class Inbox:
    """Receive queues of several links, one for each.

    ``links``: pairs of the node's name for a link, and the link. The links are read when the inbox is
    emptied. A thread also reads them periodically, because the system's own buffers are small and a step may
    be long. The thread does not wake for every datagram: on a small computer that would take time from the
    steps of all nodes.

    A flood on one link does not affect the others, because each link has a queue of its own. If more than
    ``capacity`` datagrams wait in a queue, or more than ``ROOM`` bytes, the oldest are dropped and counted in
    ``overruns``; over TCP the sender is throttled instead.
    """

    def __init__(self, links: Sequence[tuple[str, Link]], capacity: int = CAPACITY) -> None:
        self._queues = tuple(_Queue(name, link, capacity) for name, link in links)
        # The holder of this lock reads the links: two readers at once would mix up the order of arrival.
        self._reading = Lock()
        self._closing = Event()
        self._thread = None
        if any(link.fileno() is not None for _, link in links):
            self._thread = Thread(target=self._look_after, name="inbox", daemon=True)
            self._thread.start()

    @property
    def overruns(self) -> int:
        """Number of datagrams that were dropped because too many waited."""
        return sum(queue.overruns for queue in self._queues)

    def take(self) -> list[Datagram]:
        """Remove and return what has arrived, by link and in order of arrival, up to the limit of each link.

        The rest waits. Raises BridgeError if the thread has ended, which it never should.
        """
        if self._thread is not None and not self._thread.is_alive():
            raise BridgeError("the receiving thread has ended")
        with self._reading:
            self._read()
            return [datagram for queue in self._queues for datagram in queue.handful()]

    def close(self) -> None:
        """End the thread and wait for it; the links stay open. Calling it again is harmless."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _read(self) -> None:
        for queue in self._queues:
            queue.read()

    def _look_after(self) -> None:
        while not self._closing.wait(_ROUND):
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
        """Read the link, unless enough data waits already and its senders can be throttled."""
        if self._throttles and self._bytes >= HANDFUL:
            return
        for data in self._link.receive():
            self._waiting.append(Datagram(self._name, data))
            self._bytes += len(data)
        while len(self._waiting) > self._capacity or self._bytes > ROOM:
            self._pop()
            self.overruns += 1

    def handful(self) -> list[Datagram]:
        """Remove and return the oldest datagram, and further ones within the limits."""
        found: list[Datagram] = []
        room = HANDFUL
        while self._waiting and len(found) < FINGERS and (len(self._waiting[0].data) <= room or not found):
            found.append(self._pop())
            room -= len(found[-1].data)
        return found

    def _pop(self) -> Datagram:
        datagram = self._waiting.popleft()
        self._bytes -= len(datagram.data)
        return datagram
