"""The command ``outrider`` in a process that takes turns: ``python -m tests.outrider.onboard.in_turns FD …``.

FD is the number of the socket to the ``Conductor``. Both processes of ``outrider fly`` take turns.
"""

from __future__ import annotations

import socket
import sys
from collections.abc import Sequence
from multiprocessing.connection import wait
from queue import SimpleQueue
from threading import Semaphore
from types import SimpleNamespace
from typing import Any

from outrider.__main__ import main
from outrider.onboard import clocks, command, event_log, flight
from outrider.onboard.child_process import Body, ChildProcess
from outrider.onboard.process_channel import Channel, OrderLink
from tests.outrider.onboard.turns import Turns


class _Child:
    """The body of a child that takes turns."""

    def __init__(self, body: Body, turns: Turns) -> None:
        self._body, self._turns = body, turns
        self.end: socket.socket | None = None

    def main(self) -> None:
        """As that of the body."""
        assert self.end is not None
        self._turns.become(self.end)
        self._body.main()


class _Written:
    """Queue whose ``put`` returns when the reader has used the item, and asks for the next one.

    With it a line of the event log is in the file before its process waits for the clock.
    """

    def __init__(self) -> None:
        self._items: SimpleQueue[Any] = SimpleQueue()
        self._idle = Semaphore(0)

    def get(self) -> Any:
        """As that of a queue."""
        self._idle.release()
        return self._items.get()

    def put(self, item: Any) -> None:
        """As that of a queue; None is the last item, after which the reader asks for no other."""
        self._idle.acquire()
        self._items.put(item)
        if item is not None:
            self._idle.acquire()
            self._idle.release()

    def qsize(self) -> int:
        """As that of a queue."""
        return self._items.qsize()


def take_turns(turns: Turns) -> None:
    """Make ``outrider fly`` read and wait for no other clock."""

    class Child(ChildProcess):
        def __init__(self, worker: Body) -> None:
            self._body = _Child(worker, turns)
            super().__init__(self._body)

        def start(self) -> int:
            with turns.another() as self._body.end:
                return super().start()

    intercom, real = flight.intercom, flight.time

    def beside() -> tuple[Channel, OrderLink]:
        desk, orders = intercom()
        assert hasattr(orders, "_clock")
        orders._clock = turns.seconds
        return desk, orders

    def waited(ends: Sequence[Any], seconds: float) -> list[Any]:
        if not (ready := wait(ends, 0.0)):
            turns.sleep(seconds)
        return ready

    shown = SimpleNamespace(**{**vars(real), "monotonic": turns.seconds, "sleep": turns.sleep})
    patches: dict[Any, dict[str, Any]] = {
        clocks: {"WallClock": lambda: turns},
        command: {"WallClock": lambda: turns, "time": shown},
        event_log: {"SimpleQueue": _Written},
        flight: {"time": shown, "wait": waited, "ChildProcess": Child, "intercom": beside},
    }
    for module, names in patches.items():
        for name, value in names.items():
            assert hasattr(module, name)
            setattr(module, name, value)


if __name__ == "__main__":
    number = int(sys.argv.pop(1))
    take_turns(Turns(socket.socket(fileno=number)))
    main()
