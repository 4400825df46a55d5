"""Progress bar on standard error for work other than flights; without a terminal a line now and then."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from outrider.terminal.progress_lines import ProgressLines
from outrider.terminal.time_left import TimeLeft


@contextmanager
def share_progress() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar; the yielded function takes the current work and the share that is done."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description:28}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=1.0, left="")
        lines, time_left = ProgressLines(), TimeLeft()

        def watch(what: str, share: float) -> None:
            rest = time_left.words(share)
            if console.is_terminal:
                bar.update(task, description=escape(what), completed=share, left=rest)
            else:
                lines.say(lambda: f"{what}: {100.0 * share:.0f} %{rest and ', ' + rest}")

        yield watch
