"""Lines on standard error, for people and journals."""

from __future__ import annotations

import select
import sys


def say(line: str) -> None:
    """Write a line to standard error, or drop it if that would block.

    A full pipe without a reader must not hold up the vehicles.
    """
    try:
        room = select.select([], [sys.stderr], [], 0)[1]
    except (OSError, ValueError):
        room = [sys.stderr]  # not a file descriptor that select accepts
    if room:
        sys.stderr.write(f"{line}\n")
        sys.stderr.flush()
