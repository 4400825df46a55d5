"""What arrives on all links of a node, collected by a thread of its own until the node is due."""

from __future__ import annotations

import select
import socket
from collections import deque
from collections.abc import Sequence
from threading import Lock, Thread
from typing import Final

from mavlink_bridge.errors import BridgeError
from mavlink_bridge.links.link import Link
from mavlink_bridge.node import Datagram

CAPACITY: Final = 4096
"""Datagrams that wait at most."""
_PATROL: Final = 250
# ms; a link without peer is looked after so often.


class Inbox:
    """``links``: pairs of the node's name for a link, and the link. Links that can be waited for are read by
    a thread; the others, and only they, when the inbox is emptied.

    The thread is there because the system's own buffers are small and a step may be long. If more than
    ``capacity`` datagrams wait, the oldest are dropped and counted in ``overruns``.
    """

    def __init__(self, links: Sequence[tuple[str, Link]], capacity: int = CAPACITY) -> None:
        self.overruns = 0
        self._watched = {fileno: pair for pair in links if (fileno := pair[1].fileno()) is not None}
        self._asked = [pair for pair in links if pair[1].fileno() is None]
        self._waiting: deque[Datagram] = deque(maxlen=capacity)
        self._lock = Lock()
        self._closing = False
        self._bell, self._thread = None, None
        if self._watched:
            self._ear, self._bell = socket.socketpair()
            self._thread = Thread(target=self._listen, name="inbox", daemon=True)
            self._thread.start()

    def empty(self) -> list[Datagram]:
        """Take out all that waits, by link in the order of arrival. Raises BridgeError if the thread has
        ended, which it never should."""
        if self._thread is not None and not self._thread.is_alive():
            raise BridgeError("the receiving thread has ended")
        for name, link in self._asked:
            self._put(name, link)
        with self._lock:
            found = list(self._waiting)
            self._waiting.clear()
        return found

    def close(self) -> None:
        """End the thread and wait for it; the links stay open. Again is harmless."""
        if self._thread is None or self._bell is None:
            return
        self._closing = True
        self._bell.close()
        self._thread.join()
        self._ear.close()

    def _put(self, name: str, link: Link) -> None:
        datagrams = [Datagram(name, data) for data in link.receive()]
        if datagrams:
            with self._lock:
                room = (self._waiting.maxlen or 0) - len(self._waiting)
                self.overruns += max(len(datagrams) - room, 0)
                self._waiting.extend(datagrams)

    def _listen(self) -> None:
        poll = select.poll()
        for fileno in (*self._watched, self._ear.fileno()):
            poll.register(fileno, select.POLLIN)
        ear, watched = self._ear.fileno(), self._watched
        while not self._closing:
            ready = poll.poll(_PATROL)
            for fileno, _ in ready or [(one, 0) for one in watched]:
                if fileno != ear:
                    self._put(*watched[fileno])
