"""Exceptions of the command line; each determines the exit status of the process."""

from __future__ import annotations

from typing import ClassVar, NamedTuple


class OutriderError(Exception):
    """Base class of every error of ``outrider``; without a subclass it is an internal fault."""

    exit_status: ClassVar[int] = 3


class Fault(NamedTuple):
    """One fault of an input.

    ``line`` and ``column`` count from 1; None: the fault concerns the whole input. ``what`` states what is
    wrong, what is allowed, and the nearest valid word if there is one.
    """

    where: str
    what: str
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        place = self.where if self.line is None else f"{self.where}:{self.line}:{self.column}"
        return f"{place}: {self.what}"


class InputError(OutriderError):
    """Unusable input of the user.

    The message is one line for each fault, in the order of the file. A fault that is not part of a file (an
    argument) is a plain text.
    """

    exit_status = 2

    def __init__(self, *faults: Fault | str) -> None:
        super().__init__(*faults)
        self.faults = faults

    def __str__(self) -> str:
        return "\n".join(_one_line(str(fault)) for fault in self.faults)


def _one_line(text: str) -> str:
    """Return ``text`` with each character that would break a line or control a terminal as an escape."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
