"""JSON Schemas of the messages in an MCAP, in the subset that Foxglove and PlotJuggler read.

The subset is objects with fields that are numbers, texts, objects, or arrays of one of these; there are no
unions, and therefore no nulls.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

Node = dict[str, Any]


class Schema(NamedTuple):
    """Schema and its name."""

    name: str
    document: Node

    @property
    def data(self) -> bytes:
        """Schema as JSON bytes."""
        return json.dumps(self.document, separators=(",", ":"), ensure_ascii=False).encode()


def schema(name: str, what: str, /, **fields: Node) -> Schema:
    """Return the schema of the messages ``name``; every field is optional."""
    return Schema(name, {"title": name, **struct(what, **fields)})


def struct(what: str, /, **fields: Node) -> Node:
    """Return the schema of an object with named fields."""
    return {"type": "object", "description": what, "properties": fields}


def number(what: str = "") -> Node:
    """Return the schema of a real number."""
    return _described("number", what)


def integer(what: str = "") -> Node:
    """Return the schema of an integer."""
    return _described("integer", what)


def words(what: str = "") -> Node:
    """Return the schema of a text."""
    return _described("string", what)


def flag(what: str = "") -> Node:
    """Return the schema of a boolean."""
    return _described("boolean", what)


def base64(what: str = "") -> Node:
    """Return the schema of bytes in base 64; Foxglove shows them as bytes."""
    return {**words(what), "contentEncoding": "base64"}


def many(item: Node, what: str = "", count: int | None = None) -> Node:
    """Return the schema of an array of equal items, of fixed length if ``count`` is given."""
    limits = {} if count is None else {"minItems": count, "maxItems": count}
    return {**_described("array", what), "items": item, **limits}


def choice(what: str, /, **values: int) -> Node:
    """Return the schema of an enumeration: named integers."""
    return {"description": what, "oneOf": [{"title": name, "const": value} for name, value in values.items()]}


def enu(what: str) -> Node:
    """Return the schema of a fleet-local vector with the components east, north and up."""
    return struct(what, east=number(), north=number(), up=number())


def _described(kind: str, what: str) -> Node:
    return {"type": kind, "description": what} if what else {"type": kind}
