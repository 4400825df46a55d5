"""Changes of a scenario from Python, checked like a file: each fault names the key and the nearest word."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from pydantic import ValidationError
from pydantic_core import to_jsonable_python

from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.python_values import input_error
from outrider.yaml_files.yaml_file import load


def changed(name: str, changes: dict[str, Any]) -> Scenario:
    """Return a scenario, by name or file, with ``changes`` merged in, mapping by mapping.

    ``avoidance: certified`` changes a turning sense ``own`` to ``right``, as the command line does. Raises
    InputError for invalid changes.
    """
    base = load(find("scenarios", name), Scenario).model_dump()
    document = merged(base, _plain(changes))
    companion, given = document.get("companion"), changes.get("companion")
    if (
        isinstance(companion, dict)
        and isinstance(given, dict)
        and given.get("avoidance") == "certified"
        and given.get("turning_sense") is None
        and companion.get("turning_sense") == "own"
    ):
        companion["turning_sense"] = "right"
    try:
        return Scenario.model_validate(document)
    except ValidationError as error:
        raise input_error(error, Scenario, document, f"{name}, changed") from None


def merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return ``base`` with ``changes`` merged in.

    Two mappings under the same key are merged, too, unless the new one names another ``kind``.
    """
    result = deepcopy(base)
    for key, value in changes.items():
        inner = result.get(key)
        # A mapping of another kind has other keys, so it replaces the old one.
        if (
            isinstance(inner, dict)
            and isinstance(value, dict)
            and value.get("kind", inner.get("kind")) == inner.get("kind")
        ):
            value = merged(inner, value)
        result[key] = value
    return result


def _plain(value: Any) -> Any:
    """Return ``value`` with models, paths, tuples and arrays as what YAML has. Raises InputError."""
    try:
        return to_jsonable_python(value, inf_nan_mode="constants", fallback=lambda one: one.tolist())
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(f"changes: {error}; allowed: numbers, texts, lists, mappings, arrays") from None
