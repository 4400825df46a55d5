"""Translation of pydantic's errors into faults with a position in the text and the file's own key names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from pydantic_core import ErrorDetails

from outrider.suggestions import did_you_mean
from outrider.yaml_files.scalars import boolean_hint, number_hint
from outrider.yaml_files.schema_nodes import Schema, listing
from outrider.yaml_files.tree import Broken, Flaw, Items, Mapping, Scalar, Tree

_OF_A_RULE = ("value_error", "assertion_error")
_KEY = "[key]"


class _Place(NamedTuple):
    """The place to which an error's location leads.

    ``path``: keys and indices in the file; ``parent``: schema of the containing value; ``at``: position of
    the value, or of the key if the key is invalid; ``holder_at``: position of the key, or of the value if it
    has none; ``absent``: key or index that the tree lacks.
    """

    path: tuple[str | int, ...]
    tree: Tree
    schema: Schema
    parent: Schema
    at: int
    holder_at: int
    absent: str | int | None = None
    union: _Union | None = None

    @property
    def name(self) -> str:
        """Name such as ``vehicles[2].speed``."""
        return _name(self.path)


class _Union(NamedTuple):
    """The outermost union without a discriminator on the location of an error.

    ``label``: the member of the union that the location names; ``place``: the place of the union; ``depth``:
    the index of ``label`` in the location.
    """

    label: str
    place: _Place
    depth: int


class _OfUnion(NamedTuple):
    """An error at or inside a union without a discriminator, and the place of the error."""

    union: _Union
    place: _Place
    error: ErrorDetails

    @property
    def of_whole(self) -> bool:
        """Whether the error concerns the value itself and not a part of it.

        Then the value does not fit the member. Errors raised by a validator of the model do not count.
        """
        return len(self.error["loc"]) <= self.union.depth + 1 and self.error["type"] not in _OF_A_RULE


def _name(path: tuple[str | int, ...]) -> str:
    words = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(words).removeprefix(".")


def _within(path: tuple[str | int, ...]) -> str:
    return f" in {_name(path)!r}" if path else ""


def model_flaws(tree: Tree, schema: Schema, errors: Iterable[ErrorDetails]) -> list[Flaw]:
    """Return one flaw for each error.

    Of the errors of a union without a discriminator only those of the member that fits best are returned, or
    one flaw if the value fits no member.
    Errors at ``Broken`` values are skipped, because their faults are reported already.
    """
    placed = [(_locate(tree, schema, error["loc"]), error) for error in errors]
    flaws = []
    unions: dict[tuple[str | int, ...], list[_OfUnion]] = {}
    for place, error in placed:
        if isinstance(place.tree, Broken):
            continue
        if place.union is not None:
            unions.setdefault(place.union.place.path, []).append(_OfUnion(place.union, place, error))
        else:
            flaws.append(_flaw(place, error))
    for members in unions.values():
        flaws.extend(_union_flaws(members))
    return flaws


def _locate(tree: Tree, schema: Schema, location: Sequence[str | int]) -> _Place:
    """Follow a location through tree and schema.

    The location also names the members of unions; those are no keys.
    """
    place = _Place((), tree, schema, schema, tree.at, tree.at)
    for depth, part in enumerate(location):
        if place.schema.choices:
            if place.union is None and not place.schema.tags:
                place = place._replace(union=_Union(str(part), place, depth))
            place = place._replace(schema=place.schema.chosen(str(part)))
        elif part == _KEY:
            place = place._replace(at=place.holder_at)
        else:
            place = _step(place, part)
            if place.absent is not None:
                break
    return place


def _step(place: _Place, part: str | int) -> _Place:
    match place.tree:
        case Mapping(entries=entries) if str(part) in entries:
            holder_at, tree = entries[str(part)]
        case Items(items=items) if isinstance(part, int) and part < len(items):
            holder_at, tree = items[part].at, items[part]
        case _:
            return place._replace(absent=part)
    return place._replace(
        path=(*place.path, part),
        tree=tree,
        schema=place.schema.child(part),
        parent=place.schema,
        at=tree.at,
        holder_at=holder_at,
    )


def _union_flaws(found: list[_OfUnion]) -> list[Flaw]:
    """Return the errors of the union member that the value resembles; if none, what all members allow."""
    groups: dict[str, list[_OfUnion]] = {}
    for one in found:
        groups.setdefault(one.union.label, []).append(one)
    inside = [group for group in groups.values() if not any(one.of_whole for one in group)]
    if not inside:
        return [_flaw(found[0].union.place, found[0].error)]
    return [_flaw(one.place, one.error) for one in min(inside, key=len)]


def _flaw(place: _Place, error: ErrorDetails) -> Flaw:
    kind = error["type"]
    if kind == "extra_forbidden":
        key = str(error["loc"][-1])
        allowed = place.parent.keys
        hint = did_you_mean(key, allowed)
        return Flaw(place.holder_at, f"{_short(key)} is unknown; allowed: {listing(allowed)}{hint}")
    if kind == "missing" and isinstance(place.absent, str):
        needed = place.schema.child(place.absent).describe()
        return Flaw(
            place.holder_at,
            f"{place.absent!r} is missing{_within(place.path)}; needed: {needed or 'a value'}",
        )
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _tag_flaw(place)
    if kind in _OF_A_RULE:
        said = str(error.get("ctx", {}).get("error", error["msg"]))
        return Flaw(place.at, f"{place.name}: {said}" if place.path else said)
    if error["loc"][-1:] == (_KEY,):
        return Flaw(place.at, f"key {_short(str(place.path[-1]))}{_within(place.path[:-1])}: {error['msg']}")
    subject = f"{place.name} is {_shown(place.tree)}" if place.path else f"this is {_shown(place.tree)}"
    allowed_here = place.schema.describe() or error["msg"]
    return Flaw(place.at, f"{subject}; allowed: {allowed_here}{_hint(place)}")


def _tag_flaw(place: _Place) -> Flaw:
    """Return the flaw of a tagged union whose key is missing or has an invalid value."""
    key, tags = str(place.schema.tag_key), list(place.schema.tags)
    entry = place.tree.entries.get(key) if isinstance(place.tree, Mapping) else None
    allowed = listing([repr(tag) for tag in tags])
    if entry is None:
        return Flaw(place.holder_at, f"{key!r} is missing{_within(place.path)}; needed: {allowed}")
    word = entry.tree.text if isinstance(entry.tree, Scalar) else ""
    name = f"{place.name}.{key}".removeprefix(".")
    return Flaw(
        entry.tree.at, f"{name} is {_shown(entry.tree)}; allowed: {allowed}{did_you_mean(word, tags)}"
    )


def _hint(place: _Place) -> str:
    """Return a suggestion for a scalar that is not allowed, or an empty text."""
    tree, schema = place.tree, place.schema
    if not isinstance(tree, Scalar):
        return ""
    if isinstance(tree.value, str):
        if schema.words:
            return did_you_mean(tree.text, schema.words)
        if schema.types & {"number", "integer"}:
            return number_hint(tree.text)
        return boolean_hint(tree.text) if "boolean" in schema.types else ""
    if isinstance(tree.value, float) and tree.value.is_integer() and "integer" in schema.types:
        return f"; did you mean {tree.value:.0f}?"
    if "string" in schema.types and tree.text:
        return f"; write {tree.text!r} in quotes"
    return ""


def _shown(tree: Tree) -> str:
    match tree:
        case Scalar(value=None, text=text):
            return text or "empty"
        case Scalar(value=str(), text=text):
            return _short(text)
        case Scalar(text=text):
            return text
        case Items(items=items):
            return f"a list of {len(items)}"
        case Mapping():
            return "a mapping"
        case Broken():
            return "broken"


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "…")
