"""Reading a JSON Schema as pydantic writes it: from node to node as an error's location goes, or in words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

Node = Mapping[str, Any]
"""One schema: JSON, hence untyped."""

MOST_WORDS = 24
"""So many alternatives or keys are listed."""


class Schema(NamedTuple):
    """A place in a schema; ``root`` holds the definitions."""

    root: Node
    node: Node

    @property
    def resolved(self) -> Schema:
        """With references followed, and an optional value's schema in place of "that or null"."""
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
        """The members of a union, null left out; empty if this is none."""
        members = _not_null(self.resolved.node)
        return [Schema(self.root, member).resolved for member in members]

    @property
    def tags(self) -> dict[str, Schema]:
        """Of a union that a key decides: the member for each word."""
        found = self.resolved.node.get("discriminator", {}).get("mapping", {})
        return {tag: Schema(self.root, {"$ref": target}).resolved for tag, target in found.items()}

    @property
    def tag_key(self) -> str | None:
        """The key that decides such a union."""
        found = self.resolved.node.get("discriminator", {}).get("propertyName")
        return None if found is None else str(found)

    @property
    def keys(self) -> list[str]:
        """What a mapping may hold; of a union, of all its members."""
        members = self.choices or [self.resolved]
        return list(dict.fromkeys(key for member in members for key in member.node.get("properties", ())))

    def chosen(self, label: str) -> Schema:
        """The member of a union that a location names by tag, title or type; if none fits, all their keys."""
        if label in self.tags:
            return self.tags[label]
        for member in self.choices:
            # A label is a name, or names inside what wraps them: ``function-after[_order(), Gust]``.
            name = _PYDANTIC_NAMES.get(member.node.get("type", "")) or member.node.get("title")
            if name and re.search(rf"(?:^|[ -]){re.escape(name)}(?:$|[\[\]])", label):
                return member
        everything = {key: child for member in self.choices for key, child in _properties(member.node)}
        return Schema(self.root, {"properties": everything})

    def child(self, key: str | int) -> Schema:
        """What stands under a key or index; an empty schema if the schema does not say."""
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
        """The texts allowed here if they can be listed, else nothing."""
        allowed = [word for member in (self.choices or [self.resolved]) for word in _listed(member.node)]
        return [word for word in allowed if isinstance(word, str)]

    @property
    def types(self) -> set[str]:
        """The JSON types allowed here."""
        return {str(member.node.get("type", "")) for member in (self.choices or [self.resolved])}

    def describe(self) -> str:
        """What is allowed here, in words; empty if the schema does not say."""
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
    """Words with commas, the rest of a long list counted."""
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
