"""Suggestion of the valid word nearest to a mistyped one."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

LONGEST_WORD = 60
"""Characters. A longer text is no mistyped word, and comparing it would take long."""


def nearest(word: str, valid: Iterable[str]) -> str | None:
    """Return the word of ``valid`` most like ``word`` regardless of case, or None if none is alike."""
    if len(word) > LONGEST_WORD:
        return None
    by_folded = {candidate.casefold(): candidate for candidate in valid if len(candidate) <= LONGEST_WORD}
    found = get_close_matches(word.casefold(), by_folded, n=1, cutoff=0.6)
    return by_folded[found[0]] if found else None


def did_you_mean(word: str, valid: Iterable[str]) -> str:
    """Return ``; did you mean 'x'?``, or an empty string."""
    found = nearest(word, valid)
    return "" if found is None else f"; did you mean {found!r}?"


def neighbours(path: Path, suffixes: tuple[str, ...] = (".yaml", ".yml"), most: int = 8) -> list[str]:
    """Return existing files near the missing ``path``: the most similar first, then others by suffix."""
    try:
        names = sorted(entry.name for entry in path.parent.iterdir())
    except OSError:
        return []
    usable = [name for name in names if name.endswith(suffixes)]
    alike = nearest(path.name, usable) or nearest(path.name, names)
    first = [] if alike is None else [alike]
    return (first + [name for name in usable if name != alike])[:most]
