"""Line that explains a slow start: the planner is compiled."""

from __future__ import annotations

from companion.values.compiled import report_compilation
from outrider.terminal.lines import say


def say_if_compiling() -> None:
    """Print a line on standard error once if kernels are compiled; call this before they are imported."""
    report_compilation(lambda text: say(f"outrider: {text}"))
