"""Lines and columns of values in a text of JSON, which the parser of the standard library does not keep."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

_DECODER = json.JSONDecoder()
_SPACE = re.compile(r"[ \t\n\r]*")


def place_of(text: str, path: Sequence[int | str]) -> tuple[int, int]:
    """Return the line and the column, from 1, of the value at ``path`` in ``text``, which is JSON.

    ``path``: keys of objects and indices of lists. Where a value is missing, the place is that of the
    innermost object or list on its path that is there.
    """
    at = _skipped(text, 0)
    for step in path:
        found = _inside(text, at, step)
        if found is None:
            break
        at = found
    begin = text.rfind("\n", 0, at) + 1
    return text.count("\n", 0, at) + 1, at - begin + 1


def _inside(text: str, at: int, step: int | str) -> int | None:
    """Return where the value ``step`` of the object or list that begins ``at`` begins; None without one.

    Of a key that is there twice the last one counts, as for the parser.
    """
    opening = text[at]
    if opening not in "{[" or (opening == "{") != isinstance(step, str):
        return None
    found, index = None, 0
    at = _skipped(text, at + 1)
    while text[at] not in "}]":
        key: int | str = index
        if opening == "{":
            key, end = _DECODER.raw_decode(text, at)
            at = _skipped(text, _skipped(text, end) + 1)
        if key == step:
            found = at
        at = _skipped(text, _DECODER.raw_decode(text, at)[1])
        if text[at] == ",":
            at = _skipped(text, at + 1)
        index += 1
    return found


def _skipped(text: str, at: int) -> int:
    """Return the first place from ``at`` on that is no white space."""
    match = _SPACE.match(text, at)
    return at if match is None else match.end()
