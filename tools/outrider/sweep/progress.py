"""Progress of a sweep on standard error: a bar with the time left, or occasional lines without a terminal."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from outrider.sweep.runs import Ending, run_of
from outrider.sweep.tasks import Entry
from outrider.terminal.progress_lines import ProgressLines


class ResultCounter:
    """Counter and display of the runs' results. ``lost`` holds every loss of this attempt, retried or not.

    ``others``: keys of the cells with ``arrival: others``.
    """

    def __init__(self, total: int, finished: int, bar: Progress | None, others: Collection[str] = ()) -> None:
        self._others = others
        self._total, self._before, self._left = total, finished, total - finished
        self._bar = bar
        self._began = time.monotonic()
        self._lines = ProgressLines()
        self._ended = 0
        self._count = dict.fromkeys(Ending, 0)
        self._task = None if bar is None else bar.add_task("", total=total, completed=finished, words="")
        self.lost: list[Entry] = []

    def ended(self, entry: Entry) -> None:
        """Count a run that has ended."""
        ending = run_of(entry, others=entry.key in self._others).ending
        self._count[ending] += 1
        if ending is Ending.LOST:
            self.lost.append(entry)
        else:
            self._ended += 1
        self.tick()

    def tick(self) -> None:
        """Update the display."""
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=self._before + self._ended, words=self._words())
        else:
            self._lines.say(lambda: f"{self._before + self._ended}/{self._total} runs, {self._words()}")

    def _words(self) -> str:
        elapsed = time.monotonic() - self._began
        words = []
        if self._ended:
            left = (self._left - self._ended) * elapsed / self._ended
            words.append(f"{60.0 * self._ended / elapsed:.0f} a minute, {duration(left)} left")
        words += [
            f"{count} {ending.value}"
            for ending, count in self._count.items()
            if count and ending is not Ending.FINE
        ]
        return ", ".join(words) or "starting"


@contextmanager
def watching(total: int, finished: int, others: Collection[str] = ()) -> Iterator[ResultCounter]:
    """Provide a `ResultCounter` of ``total`` runs, ``finished`` of which have ended already.

    ``others``: keys of the cells with ``arrival: others``.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        yield ResultCounter(total, finished, None, others)
        return
    columns = (
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} runs"),
        TextColumn("{task.fields[words]}"),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        yield ResultCounter(total, finished, bar, others)


def duration(seconds: float) -> str:
    """Return a duration as text: ``42 s``, ``7 min``, ``1 h 05 min``."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
