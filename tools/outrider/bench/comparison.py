"""Comparison of a benchmark with an earlier one, figure by figure."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from outrider.errors import Fault, InputError

Figures = Mapping[str, object]


class Ratio(NamedTuple):
    """A figure of both benchmarks, by its path such as ``plan_step_ms.field.p50``."""

    name: str
    before: float
    now: float

    @property
    def ratio(self) -> float:
        """The present value, as a multiple of the earlier one."""
        return self.now / self.before


def earlier(path: Path) -> Figures:
    """Return the figures in a file that ``outrider bench --json`` has printed.

    Raises InputError if it cannot be read, or holds something else.
    """
    try:
        figures = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(Fault(str(path), f"cannot be read: {error.strerror}")) from None
    except (UnicodeDecodeError, json.JSONDecodeError):
        figures = None
    if not isinstance(figures, dict) or "plan_step_ms" not in figures:
        raise InputError(Fault(str(path), "is no benchmark; allowed: the output of outrider bench --json"))
    return figures


def ratios(before: Figures, now: Figures) -> list[Ratio]:
    """Return the figures that both benchmarks have and that are not zero before."""
    old = dict(_numbers(before))
    return [
        Ratio(name, old[name], value) for name, value in _numbers(now) if name in old and old[name] != 0.0
    ]


def _numbers(value: object, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield all numbers in nested mappings, with their paths."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _numbers(part, f"{name}.{key}" if name else str(key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield name, float(value)
