"""What happened, as one line of JSON for each event, and as one for people."""

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


_MOST: Final = 10_000
"""Lines that wait for the disk."""
_PATIENCE: Final = 5.0
"""s for which the end waits until all are written."""


class Diary:
    """Has ``events.jsonl`` in ``directory`` written by a thread; ``tell`` gets the lines for people.
    ``phases``: each with when it began, s; ``concerns``: how often each began. A disk that is full or stands
    still, and people who do not listen any more, hold up nobody."""

    def __init__(self, directory: Path, clock: Callable[[], float]) -> None:
        """``clock``: s since the beginning."""
        self.phases: list[tuple[str, float]] = []
        self.concerns: Counter[str] = Counter()
        self.tell: Callable[[str], None] = lambda _line: None
        self._clock = clock
        # Without a buffer, whose lock a process that is forked meanwhile would inherit.
        self._file = os.open(directory / NAME, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        self._lines: SimpleQueue[bytes | None] = SimpleQueue()
        self._writer = Thread(target=self._write, name="diary", daemon=True)
        self._writer.start()

    def note(self, what: str, text: str, at: float | None = None) -> None:
        """An event; ``at``: s of the companion's clock since it began, if it is that who tells."""
        now = round(self._clock(), 2)
        if what == "phase":
            self.phases.append((text, now))
        elif what in ("concern", "critical"):
            self.concerns[text] += 1
        event = {"wall_s": now, "clock_s": at, "what": what, "text": text}
        if self._lines.qsize() < _MOST:
            line = json.dumps(event, ensure_ascii=False) + "\n"
            self._lines.put(line.encode("utf-8", "replace"))
        with suppress(OSError, ValueError):
            self.tell(f"{now:8.1f} s  {_SENTENCES.get(what, '{}').format(text)}")

    def close(self) -> None:
        """Finish the file, if the disk lets it; nothing is noted afterwards."""
        self._lines.put(None)
        self._writer.join(_PATIENCE)

    def _write(self) -> None:
        """The thread."""
        while (line := self._lines.get()) is not None:
            with suppress(OSError):
                while line:
                    line = line[os.write(self._file, line) :]
        with suppress(OSError):
            os.close(self._file)
