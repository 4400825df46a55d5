"""Log of a flight, written by a thread; it never delays the flight.

If the log cannot be written, or a disk blocks for too long, logging stops for the rest of the flight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from types import TracebackType
from typing import Final, NamedTuple, Self

from mavlink_bridge.errors import LogError
from mavlink_bridge.loops.lockstep import Direction
from mavlink_bridge.node import Datagram
from outrider.runs.recorder import Recorder

BATCH: Final = 16
"""Number of entries handed to the thread together: some hundredths of a second.

The thread holds the interpreter lock (GIL) while it writes them, for a fraction of a millisecond.
"""
MAX_BATCHES: Final = 4096
"""Maximum number of waiting batches: a minute or two of a flight, about 20 MB."""
WRITE_TIMEOUT_S: Final = 5.0
"""Time limit (s) for writing the waiting entries at the end.

It is shorter than the time limit of the process's end (``child_process.EXIT_TIMEOUT_S``).
"""
_DISK_BLOCKED: Final = "the disk does not respond"


class _Entry(NamedTuple):
    """Arguments of one call of the observer; ``datagrams`` is None at the beginning of a step."""

    now: int
    node: str
    direction: Direction
    datagrams: Sequence[Datagram] | None


class Log:
    """Log of vehicle ``system`` in ``directory``: an observer of the loop, and a context manager.

    Only the exit from the context blocks, for at most ``timeout_s`` (s). ``report`` is called once, with the
    reason, if logging has to stop.
    """

    def __init__(
        self, directory: Path, system: int, report: Callable[[str], None], timeout_s: float = WRITE_TIMEOUT_S
    ) -> None:
        """Prepare the log; ``timeout_s``: time limit for writing the rest at the end (s)."""
        self._directory, self._system = directory, system
        self._report, self._timeout_s = report, timeout_s
        self._ended = False
        self._batch: list[_Entry] = []
        self._waiting: SimpleQueue[list[_Entry] | None] = SimpleQueue()
        self._thread = Thread(target=self._write, name="log", daemon=True)

    def __enter__(self) -> Self:
        try:
            self._thread.start()
        except RuntimeError as error:
            # The system's limit of threads is reached.
            self._end(error)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread.ident is None:
            return
        self._waiting.put(self._batch)
        self._waiting.put(None)
        self._thread.join(self._timeout_s)
        if self._thread.is_alive():
            self._end(_DISK_BLOCKED)

    def begin(self, now: int, node: str, /) -> None:
        """Record that a step of ``node`` begins at ``now`` (µs)."""
        self._add(_Entry(now, node, "in", None))

    def __call__(self, now: int, node: str, direction: Direction, datagrams: Sequence[Datagram], /) -> None:
        """Record datagrams that ``node`` receives or sends at ``now`` (µs)."""
        self._add(_Entry(now, node, direction, datagrams))

    def _add(self, entry: _Entry) -> None:
        if self._ended:
            return
        self._batch.append(entry)
        if len(self._batch) < BATCH:
            return
        self._waiting.put(self._batch)
        self._batch = []
        if self._waiting.qsize() >= MAX_BATCHES:
            # The waiting batches are still written, should the disk recover.
            self._waiting.put(None)
            self._end(_DISK_BLOCKED)

    def _write(self) -> None:
        """Write queued entries, from opening the first file to closing the last (thread body)."""
        try:
            self._directory.mkdir(exist_ok=True)
            with ExitStack() as files:
                recorder = Recorder(self._directory, [self._system], files)
                while (batch := self._waiting.get()) is not None:
                    for now, node, direction, datagrams in batch:
                        if datagrams is None:
                            recorder.begin(now, node)
                        else:
                            recorder(now, node, direction, datagrams)
        except (OSError, LogError) as error:
            self._end(error)

    def _end(self, why: object) -> None:
        if not self._ended:
            self._ended = True
            self._report(f"no log from here on: {why}")
