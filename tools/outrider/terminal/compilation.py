"""Notices that explain a slow start: numba compiles the planner, or the physics of a type of vehicle."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Final

from numba.core import event

from outrider.terminal.lines import say

_TEXTS: Final = {
    "companion": "compiling the planner: 40 s on a PC, longer on a small computer",
    "sitl": "compiling the physics of this type of vehicle: 10 to 30 s on a PC",
}
"""Text for the kernels of each package."""
_STORED, _NOT_STORED = (
    "later starts load the result",
    "no directory can be written, so every start compiles: set NUMBA_CACHE_DIR to one that can",
)


class Notices(event.Listener):
    """Calls ``to`` with a text when the first kernel of a package is about to be compiled.

    Kernels that numba loads from its store are no such event. The functions that are inlined into a kernel
    follow it and are not counted.
    """

    def __init__(self, to: Callable[[str], None]) -> None:
        self.to = to
        self._left = dict(_TEXTS)

    def on_start(self, event: event.Event) -> None:
        """Report the first compilation of a package."""
        dispatcher: Any = event.data["dispatcher"]
        text = self._left.pop(dispatcher.py_func.__module__.partition(".")[0], None)
        if text is not None:
            where = _NOT_STORED if dispatcher.stats.cache_path is None else _STORED
            self.to(f"{text}; {where}")

    def on_end(self, event: event.Event) -> None:
        """Do nothing."""


_notices: list[Notices] = []


def report_compilation(to: Callable[[str], None]) -> None:
    """Call ``to`` with a text, once for each package, before its kernels are compiled in this process.

    A later call replaces ``to``. This must be called before the modules with kernels are imported.
    """
    if _notices:
        _notices[0].to = to
        return
    _notices.append(Notices(to))
    register: Callable[[str, event.Listener], None] = event.register
    register("numba:compile", _notices[0])


def say_if_compiling() -> None:
    """Print a line on standard error if kernels are compiled: for commands."""
    report_compilation(lambda text: say(f"outrider: {text}"))


def log_if_compiling() -> None:
    """Log a warning of ``outrider`` if kernels are compiled: for Python programs, unless a command runs.

    Without logging set up, Python shows it on standard error.
    """
    if not _notices:
        report_compilation(logging.getLogger("outrider").warning)
