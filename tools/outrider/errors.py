"""Exceptions of the command line; each determines the exit status of the process."""

from __future__ import annotations

from typing import ClassVar, NamedTuple


class OutriderError(Exception):
    """Base class of every error of ``outrider``; the base class itself means a failed or stopped run."""

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

    The message is one line per fault, in the order given. A fault outside a file, for example of an
    argument, is a plain text.
    """

    exit_status = 2

    def __init__(self, *faults: Fault | str) -> None:
        super().__init__(*faults)
        self.faults = faults

    def __str__(self) -> str:
        return "\n".join(_one_line(str(fault)) for fault in self.faults)


def _one_line(text: str) -> str:
    """Return ``text`` with every unprintable character replaced by its escape sequence."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
