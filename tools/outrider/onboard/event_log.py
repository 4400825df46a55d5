"""Event log: one line of JSON per event, and one line of text for people."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Final

NAME: Final = "events.jsonl"
_SENTENCES: Final = {
    "waiting": "waits for {}",
    "mode": "mode {}",
    "autopilot": "autopilot says {!r}",
    "over": "no more: {}",
    "order": "order: {}",
    "critical": "CRITICAL: {}",
}


_MAX_WAITING_LINES: Final = 10_000
"""Maximum number of lines that wait for the disk; further lines are dropped."""
_WRITE_TIMEOUT_S: Final = 5.0
"""Time limit for writing the remaining lines at the end (s)."""


class EventLog:
    """Event log that a thread writes to ``events.jsonl`` in ``directory``.

    ``tell`` receives the lines of text. ``phases``: each phase with its start time (s). ``concerns``: how
    often each concern or critical event occurred. A full or blocked disk, or a closed terminal, never blocks
    the caller.
    """

    def __init__(self, directory: Path, clock: Callable[[], float]) -> None:
        """Open the file and start the thread; ``clock`` returns the time since the beginning (s)."""
        self.phases: list[tuple[str, float]] = []
        self.concerns: Counter[str] = Counter()
        self.tell: Callable[[str], None] = lambda _line: None
        self._clock = clock
        # Unbuffered: a process forked during a write would inherit a locked buffer.
        self._file = os.open(directory / NAME, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        self._lines: SimpleQueue[bytes | None] = SimpleQueue()
        self._writer = Thread(target=self._write, name="diary", daemon=True)
        self._writer.start()

    def note(self, what: str, text: str, at: float | None = None) -> None:
        """Record an event of kind ``what``.

        ``at``: time since the companion's start on its own clock (s), if the companion reported the event.
        """
        now = round(self._clock(), 2)
        if what == "phase":
            self.phases.append((text, now))
        elif what in ("concern", "critical"):
            self.concerns[text] += 1
        event = {"wall_s": now, "clock_s": at, "what": what, "text": text}
        if self._lines.qsize() < _MAX_WAITING_LINES:
            line = json.dumps(event, ensure_ascii=False) + "\n"
            self._lines.put(line.encode("utf-8", "replace"))
        with suppress(OSError, ValueError):
            self.tell(f"{now:8.1f} s  {_SENTENCES.get(what, '{}').format(text)}")

    def close(self) -> None:
        """Write the rest, for at most 5 s; no event may be noted afterwards."""
        self._lines.put(None)
        self._writer.join(_WRITE_TIMEOUT_S)

    def _write(self) -> None:
        """Write queued lines to the file (thread body)."""
        while (line := self._lines.get()) is not None:
            with suppress(OSError):
                while line:
                    line = line[os.write(self._file, line) :]
        with suppress(OSError):
            os.close(self._file)
