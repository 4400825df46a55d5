"""What happened, as one line of JSON for each event, and as one for people."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Final

NAME: Final = "events.jsonl"
_SENTENCES: Final = {
    "waiting": "waits for {}",
    "mode": "mode {}",
    "autopilot": "autopilot says {!r}",
    "over": "no more: {}",
    "order": "order: {}",
    "critical": "CRITICAL: {}",
}


class Diary:
    """Writes ``events.jsonl`` in ``directory``; ``tell`` gets the lines for people. ``phases``: each with
    when it began, s; ``concerns``: how often each began. A full disk, and people who do not listen any more,
    hold up nobody."""

    def __init__(self, directory: Path, clock: Callable[[], float]) -> None:
        """``clock``: s since the beginning."""
        self.phases: list[tuple[str, float]] = []
        self.concerns: Counter[str] = Counter()
        self.tell: Callable[[str], None] = lambda _line: None
        self._clock = clock
        self._file: IO[str] = (directory / NAME).open("w", encoding="utf-8")

    def note(self, what: str, text: str, at: float | None = None) -> None:
        """An event; ``at``: s of the companion's clock since it began, if it is that who tells."""
        now = round(self._clock(), 2)
        if what == "phase":
            self.phases.append((text, now))
        elif what in ("concern", "critical"):
            self.concerns[text] += 1
        event = {"wall_s": now, "clock_s": at, "what": what, "text": text}
        with suppress(OSError, ValueError):
            self._file.write(json.dumps(event, ensure_ascii=False) + "\n")
            self._file.flush()
        with suppress(OSError, ValueError):
            self.tell(f"{now:8.1f} s  {_SENTENCES.get(what, '{}').format(text)}")

    def close(self) -> None:
        """Finish the file."""
        with suppress(OSError):
            self._file.close()
