"""Suggestion of the valid word nearest to a mistyped one."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

LONGEST_WORD = 60
"""Maximum length of a compared word (characters): longer texts are no mistyped words and take long."""


def nearest(word: str, valid: Iterable[str]) -> str | None:
    """Return the word of ``valid`` most similar to ``word`` regardless of case; None if none is similar."""
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
    """Return at most ``most`` names in the folder of the missing ``path``.

    The most similar name comes first, then the others that end with one of ``suffixes``, sorted.
    """
    try:
        names = sorted(entry.name for entry in path.parent.iterdir())
    except OSError:
        return []
    usable = [name for name in names if name.endswith(suffixes)]
    alike = nearest(path.name, usable) or nearest(path.name, names)
    first = [] if alike is None else [alike]
    return (first + [name for name in usable if name != alike])[:most]
