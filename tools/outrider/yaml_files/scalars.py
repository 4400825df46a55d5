"""Meaning of a plain YAML scalar by the core schema of YAML 1.2, except that leading zeros make text.

Numbers that are not finite or out of range are errors. ``on``, ``010``, ``1:30`` and ``1_000``, which YAML
1.1 reads as a boolean or as numbers, stay text. ``1e5`` and ``0o17`` are numbers here, and text in YAML 1.1.
"""

from __future__ import annotations

import math
import re

Value = None | bool | int | float | str

_NULLS = frozenset({"", "~", "null", "Null", "NULL"})
_BOOLEANS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_DIGITS = "(?:0|[1-9][0-9]*)"
_INTEGER = re.compile(rf"[-+]?{_DIGITS}")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(rf"[-+]?(?:\.[0-9]+|{_DIGITS}(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_SEXAGESIMAL = re.compile(r"[-+]?[0-9]+(?::[0-9]+)+(?:\.[0-9]*)?")
_LONGEST_INTEGER = 24
_YAML_1_1_BOOLEANS = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}


class ScalarError(ValueError):
    """A number that no field can hold; the message says why."""


def resolve(text: str) -> Value:
    """Return the value of a plain scalar.

    Raises ScalarError for NaN, infinities, floats out of range, and integers that do not fit into 64
    bits with a sign or have more than 24 characters.
    """
    if text in _NULLS:
        return None
    if text in _BOOLEANS:
        return _BOOLEANS[text]
    if _INTEGER.fullmatch(text):
        return _integer(text, 10)
    if _BASED.fullmatch(text):
        return _integer(text, 0)
    if _NOT_FINITE.fullmatch(text):
        raise ScalarError(f"{text} is not finite; allowed: finite numbers")
    if _FLOAT.fullmatch(text):
        value = float(text)
        if not math.isfinite(value):
            raise ScalarError(f"{text[:40]} is too large; allowed: finite numbers, magnitude below 1.8e308")
        return value
    return text


def _integer(text: str, base: int) -> int:
    value = int(text, base) if len(text) <= _LONGEST_INTEGER else 1 << 63
    if not -(1 << 63) <= value < 1 << 63:
        raise ScalarError(f"{text[:40]} is out of range; allowed: integers from −2^63 to 2^63 − 1")
    return value


def number_hint(text: str) -> str:
    """Return the end of an error message, beginning with "; ", for text in place of a number; or nothing."""
    if _SEXAGESIMAL.fullmatch(text):
        return "; base 60 is not read, write one number"
    cleaned = text.strip().replace("_", "").replace(",", ".")
    sign, digits = ("-", cleaned[1:]) if cleaned.startswith("-") else ("", cleaned.removeprefix("+"))
    stripped = digits.lstrip("0")
    meant = sign + (stripped if stripped[:1].isdecimal() else "0" + stripped)
    if len(text) > _LONGEST_INTEGER or not _FLOAT.fullmatch(meant):
        return ""
    return f"; did you mean {meant}?" if meant != text else "; remove the quotes"


def boolean_hint(text: str) -> str:
    """Return the end of an error message, beginning with "; ", for text in place of a boolean; or nothing."""
    meant = _YAML_1_1_BOOLEANS.get(text.casefold())
    return "" if meant is None else f"; did you mean {meant}?"
