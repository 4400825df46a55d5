"""Parser from YAML text to a tree of values with their positions.

No text can construct an object, recurse deeply or consume excessive memory: tags are refused, depth is
bounded, and every alias is charged with the size of its value.

Faults are collected. A value that cannot be used becomes ``Broken``, so that the rest is still checked.
"""

from __future__ import annotations

from typing import NamedTuple

import yaml

from outrider.yaml_files.scalars import ScalarError, Value, resolve

MOST_DEPTH = 32
MOST_WEIGHT = 1_600_000
"""Limit of the weight of all values, with aliases expanded.

A value weighs 32 plus its characters, hence there are at most 50,000 values.
"""

_WEIGHT_OF_NODE = 32


class Flaw(NamedTuple):
    """A fault; ``at`` is its distance from the start of the text, in characters."""

    at: int
    what: str


class Scalar(NamedTuple):
    """A scalar.

    ``text`` without quotes and with escapes replaced, its ``value``, and whether it was ``plain``: neither
    quoted nor a block.
    """

    at: int
    value: Value
    text: str
    plain: bool


class Items(NamedTuple):
    """A sequence."""

    at: int
    items: tuple[Tree, ...]


class Entry(NamedTuple):
    """The position of a key, and its value."""

    at: int
    tree: Tree


class Mapping(NamedTuple):
    """A mapping; keys are words, stored as text whatever they look like."""

    at: int
    entries: dict[str, Entry]


class Broken(NamedTuple):
    """A value whose fault is reported already."""

    at: int


Tree = Scalar | Items | Mapping | Broken
Plain = None | bool | int | float | str | list["Plain"] | dict[str, "Plain"]


class Parsed(NamedTuple):
    """Result of parsing.

    ``tree`` is None if the text is empty or cannot be used (broken syntax, or a limit is exceeded). In the
    second case ``flaws`` has the reason.
    """

    tree: Tree | None
    flaws: list[Flaw]


class _Sized(NamedTuple):
    """A finished tree, its weight, and its number of levels."""

    tree: Tree
    weight: int
    height: int


class _Stop(Exception):  # noqa: N818 — no error for callers: it ends the parsing of an unusable text
    def __init__(self, flaw: Flaw) -> None:
        super().__init__(flaw.what)
        self.flaw = flaw


def parse(text: str) -> Parsed:
    """Parse ``text``, which holds one document."""
    reading = _Reading()
    try:
        tree = reading.document(text)
    except _Stop as stop:
        return Parsed(None, [*reading.flaws, stop.flaw])
    return Parsed(tree, reading.flaws)


def plain(tree: Tree) -> Plain:
    """Return the values alone, as in JSON; null for what is broken."""
    match tree:
        case Scalar():
            return tree.value
        case Items():
            return [plain(item) for item in tree.items]
        case Mapping():
            return {key: plain(entry.tree) for key, entry in tree.entries.items()}
        case Broken():
            return None


class _Reading:
    """One pass over the events of a text."""

    def __init__(self) -> None:
        self.flaws: list[Flaw] = []
        self._anchors: dict[str, _Sized] = {}
        self._weight = 0
        self._loader: yaml.SafeLoader

    def document(self, text: str) -> Tree | None:
        try:
            self._loader = yaml.SafeLoader(text)
        except yaml.reader.ReaderError as error:
            raise _Stop(Flaw(error.position, f"character U+{error.character:04X} is not allowed")) from None
        self._next()
        if isinstance(self._next(), yaml.StreamEndEvent):
            return None
        tree = self._tree(self._next(), 1).tree
        self._next()
        after = self._next()
        if not isinstance(after, yaml.StreamEndEvent):
            self.flaws.append(Flaw(_start(after), "a second document; allowed: one in a file"))
        return tree

    def _next(self) -> yaml.Event:
        try:
            event: yaml.Event = self._loader.get_event()  # type: ignore[no-untyped-call]
        except yaml.MarkedYAMLError as error:
            raise _Stop(_syntax_flaw(error)) from None
        except (ValueError, OverflowError):
            # The library turns an escape such as "\UFFFFFFFF" into a character without a check.
            raise _Stop(Flaw(self._loader.index, "a number or character code that does not exist")) from None
        return event

    def _tree(self, event: yaml.Event, depth: int) -> _Sized:
        at = _start(event)
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, at, depth)
        self._charge(_WEIGHT_OF_NODE, at)
        if depth > MOST_DEPTH:
            raise _Stop(Flaw(at, f"nested too deeply; allowed: {MOST_DEPTH} levels"))
        before = self._weight - _WEIGHT_OF_NODE
        height = 0
        tree: Tree
        if isinstance(event, yaml.ScalarEvent):
            tree = self._scalar(event, at)
        elif isinstance(event, yaml.SequenceStartEvent):
            tree, height = self._items(at, depth)
        else:
            tree, height = self._mapping(at, depth)
        if isinstance(event, yaml.NodeEvent) and (tag := getattr(event, "tag", None)) is not None:
            self.flaws.append(Flaw(at, f"tag {_shown(tag)} is not allowed; allowed: plain values"))
            tree = Broken(at)
        sized = _Sized(tree, self._weight - before, height + 1)
        if isinstance(event, yaml.NodeEvent) and event.anchor is not None:
            self._anchors[event.anchor] = sized
        return sized

    def _alias(self, event: yaml.AliasEvent, at: int, depth: int) -> _Sized:
        sized = self._anchors.get(event.anchor or "")
        if sized is None:
            self.flaws.append(
                Flaw(at, f"alias {_shown(event.anchor or '')} names no finished value above it")
            )
            self._charge(_WEIGHT_OF_NODE, at)
            return _Sized(Broken(at), _WEIGHT_OF_NODE, 1)
        if depth + sized.height - 1 > MOST_DEPTH:
            raise _Stop(Flaw(at, f"nested too deeply by an alias; allowed: {MOST_DEPTH} levels"))
        self._charge(sized.weight, at)
        return sized

    def _charge(self, weight: int, at: int) -> None:
        self._weight += weight
        if self._weight > MOST_WEIGHT:
            most = MOST_WEIGHT // _WEIGHT_OF_NODE
            raise _Stop(Flaw(at, f"too much, aliases expanded; allowed: {most} values"))

    def _scalar(self, event: yaml.ScalarEvent, at: int) -> Tree:
        self._charge(len(event.value), at)
        try:
            text = _joined(event.value)
            value = resolve(text) if event.style is None else text
        except UnicodeDecodeError:
            self.flaws.append(Flaw(at, "half of a surrogate pair is no character"))
            return Broken(at)
        except ScalarError as error:
            self.flaws.append(Flaw(at, str(error)))
            return Broken(at)
        return Scalar(at, value, text, event.style is None)

    def _items(self, at: int, depth: int) -> tuple[Tree, int]:
        items: list[Tree] = []
        height = 0
        while not isinstance(event := self._next(), yaml.SequenceEndEvent):
            sized = self._tree(event, depth + 1)
            items.append(sized.tree)
            height = max(height, sized.height)
        return Items(at, tuple(items)), height

    def _mapping(self, at: int, depth: int) -> tuple[Tree, int]:
        entries: dict[str, Entry] = {}
        height = 0
        while not isinstance(event := self._next(), yaml.MappingEndEvent):
            key_at = _start(event)
            key = self._key(self._tree(event, depth + 1).tree, key_at, entries)
            sized = self._tree(self._next(), depth + 1)
            height = max(height, sized.height)
            if key is not None:
                entries[key] = Entry(key_at, sized.tree)
        return Mapping(at, entries), height

    def _key(self, tree: Tree, at: int, entries: dict[str, Entry]) -> str | None:
        """Return the key, or None if it is invalid; its fault is then recorded."""
        if isinstance(tree, Broken):
            return None
        if not isinstance(tree, Scalar) or (tree.plain and tree.value is None):
            self.flaws.append(Flaw(at, "a key must be a word"))
        elif tree.plain and tree.text == "<<":
            self.flaws.append(Flaw(at, "merge key '<<' is not supported; write the keys out"))
        elif tree.text in entries:
            self.flaws.append(Flaw(at, f"key {_shown(tree.text)} is there twice; allowed: once"))
        else:
            return tree.text
        return None


def _start(event: yaml.Event) -> int:
    return 0 if event.start_mark is None else event.start_mark.index


def _joined(text: str) -> str:
    """Return ``text`` with surrogate pairs joined; JSON escapes characters beyond U+FFFF as such pairs.

    Raises UnicodeDecodeError for half a pair.
    """
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le")


def _syntax_flaw(error: yaml.MarkedYAMLError) -> Flaw:
    mark = error.problem_mark or error.context_mark
    since = "" if error.context_mark is None else f" that starts in line {error.context_mark.line + 1}"
    what = f"{error.context}{since}, {error.problem}" if error.context else str(error.problem)
    hint = "; indent with spaces" if "'\\t'" in what else ""
    return Flaw(0 if mark is None else mark.index, f"not YAML: {what}{hint}")


def _shown(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "…")
