"""What arrives on all links of a node, kept until the node is due."""

from __future__ import annotations

import selectors
from collections import deque
from collections.abc import Iterable, Sequence
from threading import Event, Lock, Thread
from typing import Final

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.links.link import Link
from mavlink_bridge.node import Datagram

CAPACITY: Final = 4096
"""Datagrams that wait at most."""
_ROUND: Final = 0.02
# s; in so long no link fills the buffer that the system keeps for it, not even a fast serial port.
_ROUNDS: Final = 25
# Every so many of the thread's rounds all links are read, so that those that have lost a peer look for it.


class Inbox:
    """``links``: pairs of the node's name for a link, and the link. Those that have something are read when
    the inbox is emptied; and now and then by a thread, because the system's own buffers are small and a step
    may be long. The thread does not wake for every datagram: its turns would be taken from the steps of all
    on a small computer.

    If more than ``capacity`` datagrams wait, the oldest are dropped and counted in ``overruns``.
    """

    def __init__(self, links: Sequence[tuple[str, Link]], capacity: int = CAPACITY) -> None:
        self.overruns = 0
        self._links = tuple(links)
        # One question to the system instead of one for each link.
        self._selector = selectors.DefaultSelector()
        self._asked = [pair for pair in links if pair[1].fileno() is None]
        for name, link in links:
            fileno = link.fileno()
            if fileno is not None:
                self._selector.register(fileno, selectors.EVENT_READ, (name, link))
        self._waiting: deque[Datagram] = deque(maxlen=capacity)
        # Whoever has it reads links: two at once would mix up the order of arrival.
        self._reading = Lock()
        self._closing = Event()
        self._thread = None
        if len(self._asked) < len(self._links):
            self._thread = Thread(target=self._look_after, name="inbox", daemon=True)
            self._thread.start()

    def empty(self) -> list[Datagram]:
        """Take out all that has arrived, by link in the order of arrival. Raises BridgeError if the thread
        has ended, which it never should."""
        if self._thread is not None and not self._thread.is_alive():
            raise BridgeError("the receiving thread has ended")
        with self._reading:
            self._read([*(key.data for key, _ in self._selector.select(0)), *self._asked])
            found = list(self._waiting)
            self._waiting.clear()
        return found

    def close(self) -> None:
        """End the thread and wait for it; the links stay open. Again is harmless."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._selector.close()

    def _read(self, links: Iterable[tuple[str, Link]]) -> None:
        for name, link in links:
            datagrams = [Datagram(name, data) for data in link.receive()]
            if datagrams:
                room = (self._waiting.maxlen or 0) - len(self._waiting)
                self.overruns += max(len(datagrams) - room, 0)
                self._waiting.extend(datagrams)

    def _look_after(self) -> None:
        rounds = 0
        while not self._closing.wait(_ROUND):
            rounds += 1
            with self._reading:
                every = rounds % _ROUNDS == 0
                self._read(self._links if every else [key.data for key, _ in self._selector.select(0)])
