"""JSON Schemas of what goes into an MCAP, as narrow as Foxglove and PlotJuggler read them: objects whose
fields are numbers, texts, objects, or arrays of one of these; no unions, hence no nulls."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

Node = dict[str, Any]


class Schema(NamedTuple):
    """A schema with the name that tools know it by."""

    name: str
    document: Node

    @property
    def data(self) -> bytes:
        """As it is written."""
        return json.dumps(self.document, separators=(",", ":"), ensure_ascii=False).encode()


def schema(name: str, what: str, /, **fields: Node) -> Schema:
    """Of messages ``name``; every field may be left out."""
    return Schema(name, {"title": name, **struct(what, **fields)})


def struct(what: str, /, **fields: Node) -> Node:
    """An object with named fields."""
    return {"type": "object", "description": what, "properties": fields}


def number(what: str = "") -> Node:
    """A real number."""
    return _described("number", what)


def integer(what: str = "") -> Node:
    """A whole number."""
    return _described("integer", what)


def words(what: str = "") -> Node:
    """A text."""
    return _described("string", what)


def flag(what: str = "") -> Node:
    """True or false."""
    return _described("boolean", what)


def base64(what: str = "") -> Node:
    """Bytes, written in base 64; Foxglove shows them as bytes."""
    return {**words(what), "contentEncoding": "base64"}


def many(item: Node, what: str = "", count: int | None = None) -> Node:
    """An array of items of one kind."""
    limits = {} if count is None else {"minItems": count, "maxItems": count}
    return {**_described("array", what), "items": item, **limits}


def choice(what: str, /, **values: int) -> Node:
    """One of several numbers that have names."""
    return {"description": what, "oneOf": [{"title": name, "const": value} for name, value in values.items()]}


def enu(what: str) -> Node:
    """A vector, fleet-local."""
    return struct(what, east=number(), north=number(), up=number())


def _described(kind: str, what: str) -> Node:
    return {"type": kind, "description": what} if what else {"type": kind}
