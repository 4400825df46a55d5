"""A fuzz campaign: numbered mutants, each with its own generator, under a watch on time and memory.

A mutant is told by seed and index alone. Where a node hears many of them in succession they come in sessions
of ``SESSION``, so that one can be run again with no more than those before it in its session.
"""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType, TracebackType
from typing import Self

SESSION = 50
CPU_LIMIT_S = 20.0
"""s of CPU time for one mutant; it takes milliseconds. Only what hangs takes so long."""
HEADROOM = 1 << 30
"""Bytes of address space that a piece may need beyond what the process has."""


class TookTooLongError(Exception):
    """A mutant that does not come to an end."""


class Mutant:
    """One of a campaign: ``random`` is its own. A context manager around all that is done with it: it bounds
    the CPU time, and what fails says how to run it alone."""

    def __init__(self, name: str, seed: int, index: int) -> None:
        self.random = Random(f"{name} {seed} {index}")
        self.index = index
        self._advice = f"mutant {index} of seed {seed}; alone: pytest {name} --mutants {seed}:{index}"

    def __enter__(self) -> Self:
        self._before = signal.signal(signal.SIGVTALRM, _took_too_long)
        signal.setitimer(signal.ITIMER_VIRTUAL, CPU_LIMIT_S)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, self._before)
        if error is not None:
            error.add_note(self._advice)


@dataclass(frozen=True)
class Mutants:
    """A piece of the campaign ``name`` (the test) of ``seed``."""

    name: str
    seed: int
    indices: range

    def __iter__(self) -> Iterator[Mutant]:
        return (Mutant(self.name, self.seed, index) for index in self.indices)

    def sessions(self) -> Iterator[list[Mutant]]:
        """All of them, those of a session together; of one that is wanted alone, what came before it too."""
        first = self.indices.start - self.indices.start % SESSION
        for start in range(first, self.indices.stop, SESSION):
            stop = min(start + SESSION, self.indices.stop)
            yield [Mutant(self.name, self.seed, index) for index in range(start, stop)]


def _took_too_long(_signal: int, _frame: FrameType | None) -> None:
    raise TookTooLongError(f"{CPU_LIMIT_S} s of CPU time were not enough")


@contextmanager
def bounded_memory() -> Iterator[None]:
    """Whoever asks for a gigabyte more than the process has gets MemoryError; where the system can tell."""
    pages = Path("/proc/self/statm")
    if not pages.exists():
        yield
        return
    now = int(pages.read_text().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = now + HEADROOM
    resource.setrlimit(resource.RLIMIT_AS, (most if soft < 0 else min(soft, most), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
