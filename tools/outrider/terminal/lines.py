"""Lines on standard error, for people and journals."""

from __future__ import annotations

import select
import sys


def say(line: str) -> None:
    """Unless nobody reads: who only starts vehicles shall not hold them up by a pipe that is full."""
    try:
        room = select.select([], [sys.stderr], [], 0)[1]
    except (OSError, ValueError):
        room = [sys.stderr]  # no file of the system's
    if room:
        sys.stderr.write(f"{line}\n")
        sys.stderr.flush()
