"""What arrives on all links of a node, kept until the node is due."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from threading import Event, Lock, Thread
from typing import Final

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.links.link import Link
from mavlink_bridge.node import Datagram

CAPACITY: Final = 4096
"""Datagrams that wait at most."""
_ROUND: Final = 0.02
# s; in so long no link fills the buffer that the system keeps for it, not even a fast serial port.


class Inbox:
    """``links``: pairs of the node's name for a link, and the link. They are read when the inbox is emptied;
    and now and then by a thread, because the system's own buffers are small and a step may be long. The
    thread does not wake for every datagram: its turns would be taken from the steps of all on a small
    computer.

    If more than ``capacity`` datagrams wait, the oldest are dropped and counted in ``overruns``.
    """

    def __init__(self, links: Sequence[tuple[str, Link]], capacity: int = CAPACITY) -> None:
        self.overruns = 0
        self._links = tuple(links)
        self._waiting: deque[Datagram] = deque(maxlen=capacity)
        # Whoever has it reads links: two at once would mix up the order of arrival.
        self._reading = Lock()
        self._closing = Event()
        self._thread = None
        if any(link.fileno() is not None for _, link in links):
            self._thread = Thread(target=self._look_after, name="inbox", daemon=True)
            self._thread.start()

    def empty(self) -> list[Datagram]:
        """Take out all that has arrived, by link in the order of arrival. Raises BridgeError if the thread
        has ended, which it never should."""
        if self._thread is not None and not self._thread.is_alive():
            raise BridgeError("the receiving thread has ended")
        with self._reading:
            self._read()
            found = list(self._waiting)
            self._waiting.clear()
        return found

    def close(self) -> None:
        """End the thread and wait for it; the links stay open. Again is harmless."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _read(self) -> None:
        for name, link in self._links:
            datagrams = [Datagram(name, data) for data in link.receive()]
            if datagrams:
                room = (self._waiting.maxlen or 0) - len(self._waiting)
                self.overruns += max(len(datagrams) - room, 0)
                self._waiting.extend(datagrams)

    def _look_after(self) -> None:
        while not self._closing.wait(_ROUND):
            with self._reading:
                self._read()
