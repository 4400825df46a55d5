"""The log of a flight, which is worth less than the flight: a thread writes it, and where it cannot be
written, or a disk stands still for too long, there is none from then on."""

from __future__ import annotations

from collections.abc import Callable
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
"""Entries that are handed to the thread together: some hundredths of a second, which it writes within a
fraction of a millisecond, as nobody else runs meanwhile."""
MOST: Final = 4096
"""Batches that wait at most: a minute or two of a flight, and some 20 MB."""
PATIENCE: Final = 5.0
"""s for which the end waits until all is written; less than the process has to leave its files."""
_STILL: Final = "the disk stands still"


class _Entry(NamedTuple):
    """What a tap is told; without ``datagram``: that a step begins."""

    now: int
    node: str
    direction: Direction
    datagram: Datagram | None


class Log:
    """A tap that never waits, and a context manager: that of vehicle ``system`` in ``directory``. ``tell``
    hears once why it ended, if it has to."""

    def __init__(
        self, directory: Path, system: int, tell: Callable[[str], None], patience: float = PATIENCE
    ) -> None:
        """``patience``: s."""
        self._directory, self._system = directory, system
        self._tell, self._patience = tell, patience
        self._ended = False
        self._batch: list[_Entry] = []
        self._waiting: SimpleQueue[list[_Entry] | None] = SimpleQueue()
        self._thread = Thread(target=self._write, name="log", daemon=True)

    def __enter__(self) -> Self:
        try:
            self._thread.start()
        except RuntimeError as error:
            # As many threads as the system allows.
            self._end(error)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread.ident is None:
            return
        self._waiting.put(self._batch)
        self._waiting.put(None)
        self._thread.join(self._patience)
        if self._thread.is_alive():
            self._end(_STILL)

    def begin(self, now: int, node: str, /) -> None:
        self._add(_Entry(now, node, "in", None))

    def __call__(self, now: int, node: str, direction: Direction, datagram: Datagram, /) -> None:
        self._add(_Entry(now, node, direction, datagram))

    def _add(self, entry: _Entry) -> None:
        if self._ended:
            return
        self._batch.append(entry)
        if len(self._batch) < BATCH:
            return
        self._waiting.put(self._batch)
        self._batch = []
        if self._waiting.qsize() >= MOST:
            # What waits is written yet, should the disk go on.
            self._waiting.put(None)
            self._end(_STILL)

    def _write(self) -> None:
        """The thread: from the first file opened to the last closed."""
        try:
            self._directory.mkdir(exist_ok=True)
            with ExitStack() as files:
                recorder = Recorder(self._directory, [self._system], files)
                while (batch := self._waiting.get()) is not None:
                    for now, node, direction, datagram in batch:
                        if datagram is None:
                            recorder.begin(now, node)
                        else:
                            recorder(now, node, direction, datagram)
        except (OSError, LogError) as error:
            self._end(error)

    def _end(self, why: object) -> None:
        if not self._ended:
            self._ended = True
            self._tell(f"no log from here on: {why}")
