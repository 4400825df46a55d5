"""The log of a flight, which is worth less than the flight: where it cannot be written, there is none from
then on."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from mavlink_bridge.errors import LogError
from mavlink_bridge.node import Datagram
from mavlink_bridge.runtime import Direction
from outrider.recorder import Recorder


class Log:
    """A tap, and a context manager: that of vehicle ``system`` in ``directory``. ``tell`` hears why it ended,
    if it has to."""

    def __init__(self, directory: Path, system: int, tell: Callable[[str], None]) -> None:
        self._files = ExitStack()
        self._tell = tell
        self._recorder: Recorder | None = None
        try:
            directory.mkdir(exist_ok=True)
            self._recorder = Recorder(directory, [system], self._files)
        except (OSError, LogError) as error:
            self._end(error)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._files.close()
        except OSError as end:
            self._end(end)

    def begin(self, now: int, node: str, /) -> None:
        if self._recorder is not None:
            self._recorder.begin(now, node)

    def __call__(self, now: int, node: str, direction: Direction, datagram: Datagram, /) -> None:
        if self._recorder is None:
            return
        try:
            self._recorder(now, node, direction, datagram)
        except OSError as error:
            self._end(error)
            with suppress(OSError):
                self._files.close()

    def _end(self, error: Exception) -> None:
        self._recorder = None
        self._tell(f"no log from here on: {error}")
