"""Faults of values from Python, described like a file's: the key, what is allowed, the nearest word."""

from __future__ import annotations

from typing import Any

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import to_jsonable_python

from outrider.errors import InputError
from outrider.yaml_files.model_faults import model_flaws
from outrider.yaml_files.schema_nodes import Schema
from outrider.yaml_files.tree import parse


def input_error(
    error: ValidationError, model: type[BaseModel], values: dict[str, Any], where: str
) -> InputError:
    """Return the error with a line for each fault that ``error`` found in the ``values`` of ``model``.

    Each line begins with ``where``.
    """
    schema = model.model_json_schema()
    found = error.errors(include_url=False, include_input=False)
    try:
        text = yaml.safe_dump(
            to_jsonable_python(values, inf_nan_mode="constants", fallback=_plain),
            sort_keys=False,
            allow_unicode=True,
        )
    except UnicodeDecodeError:
        text = ""
    tree, _ = parse(text)
    flaws = () if tree is None else dict.fromkeys(model_flaws(tree, Schema(schema, schema), found))
    # A fault that a file cannot have, such as bytes, is named as the model names it.
    said = [flaw.what for flaw in flaws] or [
        f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in found
    ]
    return InputError(*(f"{where}: {what}" for what in said))


def _plain(value: Any) -> Any:
    """Return an array as lists, and what YAML lacks as text."""
    return value.tolist() if hasattr(value, "tolist") else repr(value)
