"""Words for a command line that cannot be read: which option, what it was given, what is allowed."""

from __future__ import annotations

from typing import Any, Final

_NUMBERS: Final = {"int": "a whole number", "float": "a number"}


def usage_words(error: Any) -> str:
    """Return one line, without a full stop, for an error of typer with ``param`` and ``format_message()``.

    A number that is none or out of range: the option, the text, the allowed range. A missing option or
    argument: its name and its help. Everything else: typer's own words.
    """
    said = str(error.format_message()).rstrip(".")
    parameter = getattr(error, "param", None)
    if parameter is None:
        return said
    number = _NUMBERS.get(_type_name(parameter))
    wrong = _input_of(error.__cause__)
    if number is not None and wrong is not None:
        return f"{_name(parameter)} {wrong}: allowed: {number}{_range(parameter)}"
    meaning = str(getattr(parameter, "help", None) or "").rstrip(".")
    return f"{said}: {meaning}" if said.startswith("Missing") and meaning else said


def _type_name(parameter: Any) -> str:
    """Return the name of the type that typer converts to; empty if this version does not tell it."""
    bare = getattr(parameter, "bare_type", None)
    return str(bare()) if callable(bare) else ""


def _name(parameter: Any) -> str:
    return str(parameter.opts[0])


def _input_of(cause: Any) -> str | None:
    """Return the text that could not be converted, if the error tells it."""
    faults = cause.errors() if hasattr(cause, "errors") else ()
    return None if not faults else str(faults[0].get("input"))


def _range(parameter: Any) -> str:
    least, most = getattr(parameter, "min", None), getattr(parameter, "max", None)
    ends = [f"{sign} {end:g}" for sign, end in (("≥", least), ("≤", most)) if end is not None]
    return " " + " and ".join(ends) if ends else ""
