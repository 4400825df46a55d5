"""Reader of a JSON Schema from pydantic: navigation along an error's location, and description in words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

Node = Mapping[str, Any]
"""One schema: JSON, hence untyped."""

MOST_WORDS = 24
"""Largest number of alternatives or keys that are listed."""


class Schema(NamedTuple):
    """A place in a schema; ``root`` holds the definitions."""

    root: Node
    node: Node

    @property
    def resolved(self) -> Schema:
        """The schema with references followed, and "value or null" replaced by the value's schema."""
        node = self.node
        while True:
            if "$ref" in node:
                node = self.root["$defs"][node["$ref"].rsplit("/", 1)[-1]]
            elif len(node.get("allOf", ())) == 1:
                node = node["allOf"][0]
            elif len(present := _not_null(node)) == 1 and "type" not in node:
                node = present[0]
            else:
                return Schema(self.root, node)

    @property
    def choices(self) -> list[Schema]:
        """The members of a union without null; empty if this is no union."""
        members = _not_null(self.resolved.node)
        return [Schema(self.root, member).resolved for member in members]

    @property
    def tags(self) -> dict[str, Schema]:
        """The member for each word of a tagged union."""
        found = self.resolved.node.get("discriminator", {}).get("mapping", {})
        return {tag: Schema(self.root, {"$ref": target}).resolved for tag, target in found.items()}

    @property
    def tag_key(self) -> str | None:
        """The key that decides a tagged union."""
        found = self.resolved.node.get("discriminator", {}).get("propertyName")
        return None if found is None else str(found)

    @property
    def keys(self) -> list[str]:
        """The keys that a mapping may hold; for a union, those of all its members."""
        members = self.choices or [self.resolved]
        return list(dict.fromkeys(key for member in members for key in member.node.get("properties", ())))

    def chosen(self, label: str) -> Schema:
        """Return the member of a union that a location names by tag, title or type.

        If none fits, return a schema with the keys of all members.
        """
        if label in self.tags:
            return self.tags[label]
        for member in self.choices:
            # A label is a name, or names inside their wrappers: ``function-after[_order(), Gust]``.
            name = _PYDANTIC_NAMES.get(member.node.get("type", "")) or member.node.get("title")
            if name and re.search(rf"(?:^|[ -]){re.escape(name)}(?:$|[\[\]])", label):
                return member
        everything = {key: child for member in self.choices for key, child in _properties(member.node)}
        return Schema(self.root, {"properties": everything})

    def child(self, key: str | int) -> Schema:
        """Return the schema under a key or index; an empty one if the schema does not define it."""
        node = self.resolved.node
        if isinstance(key, int):
            ahead = node.get("prefixItems", ())
            found = ahead[key] if key < len(ahead) else node.get("items")
        else:
            found = node.get("properties", {}).get(key, node.get("additionalProperties"))
            if found is None:
                found = next((c.child(key).node for c in self.choices if key in c.keys), None)
        return Schema(self.root, found if isinstance(found, Mapping) else {})

    @property
    def words(self) -> list[str]:
        """The allowed texts if they can be listed, else an empty list."""
        allowed = [word for member in (self.choices or [self.resolved]) for word in _listed(member.node)]
        return [word for word in allowed if isinstance(word, str)]

    @property
    def types(self) -> set[str]:
        """The allowed JSON types."""
        return {str(member.node.get("type", "")) for member in (self.choices or [self.resolved])}

    def describe(self) -> str:
        """Describe in words what is allowed; empty if the schema does not say."""
        null = " or null" if any(member.get("type") == "null" for member in _members(self.node)) else ""
        return self._describe() + null

    def _describe(self) -> str:
        choices = self.choices
        if choices:
            return " or ".join(dict.fromkeys(word for choice in choices if (word := choice.describe())))
        node = self.resolved.node
        if listed := _listed(node):
            return listing([_value(word) for word in listed])
        match node.get("type"):
            case "number":
                return "a number" + _bounds(node)
            case "integer":
                return "a whole number" + _bounds(node)
            case "boolean":
                return "true or false"
            case "string":
                return "text" + _shape(node)
            case "array":
                return self._describe_array()
            case "object":
                return "a mapping" + self._describe_keys()
            case "null":
                return "null"
        return ""

    def _describe_keys(self) -> str:
        required = list(self.resolved.node.get("required", ()))
        rest = [key for key in self.keys if key not in required]
        said = [f"with {listing(required)}"] if required else []
        if rest:
            said.append(f"optionally with {listing(rest)}")
        return " " + ", ".join(said) if said else ""

    def _describe_array(self) -> str:
        node = self.resolved.node
        low, high = node.get("minItems", 0), node.get("maxItems")
        count = f"{low}" if low == high else f"{low} to {high}" if high is not None else f"{low} or more"
        ahead = [Schema(self.root, item).describe() for item in node.get("prefixItems", ())]
        if "items" in node:
            ahead.append(Schema(self.root, node["items"]).describe())
        kinds = list(dict.fromkeys(kind for kind in ahead if kind))
        each = f", each {kinds[0]}" if len(kinds) == 1 else f": {', '.join(kinds)}" if kinds else ""
        return f"a list of {count}{each}"


_PYDANTIC_NAMES = {"number": "float", "integer": "int", "string": "str", "boolean": "bool", "array": "list"}


def listing(words: list[str]) -> str:
    """Join words with commas; count the rest of a long list."""
    rest = len(words) - MOST_WORDS
    return ", ".join(words[:MOST_WORDS]) + (f", … ({rest} more)" if rest > 0 else "")


def _members(node: Node) -> list[Node]:
    return node.get("anyOf") or node.get("oneOf") or []


def _not_null(node: Node) -> list[Node]:
    return [member for member in _members(node) if member.get("type") != "null"]


def _properties(node: Node) -> list[tuple[str, Node]]:
    return list(node.get("properties", {}).items())


def _listed(node: Node) -> list[Any]:
    return [node["const"]] if "const" in node else list(node.get("enum", ()))


def _value(value: object) -> str:
    return repr(value) if isinstance(value, str) else str(value).lower()


def _bounds(node: Node) -> str:
    signs = (("exclusiveMinimum", ">"), ("minimum", "≥"), ("exclusiveMaximum", "<"), ("maximum", "≤"))
    said = [f"{sign} {node[key]:.12g}" for key, sign in signs if key in node]
    multiple = f", a multiple of {node['multipleOf']:.12g}" if "multipleOf" in node else ""
    return (" " + " and ".join(said) if said else "") + multiple


def _shape(node: Node) -> str:
    ways = (
        ("minLength", "of at least {} characters"),
        ("maxLength", "of at most {} characters"),
        ("pattern", "matching {}"),
    )
    return "".join(f" {way.format(node[key])}" for key, way in ways if key in node)
