"""Commands ``outrider list`` and ``outrider new``."""

from __future__ import annotations

import json
import re
import shutil
import sys
import textwrap
from pathlib import Path

from outrider.catalogue.shipped import KINDS, RUNS, Item, items
from outrider.errors import InputError
from outrider.resources import config_root, find
from outrider.suggestions import did_you_mean

_ONE: dict[str, str] = {kind.removesuffix("s"): kind for kind in KINDS}
"""Folder of each kind that ``new`` copies."""
_LEAST_ROOM = 20
"""Number of characters below which a description is not wrapped."""


def show(kind: str | None, as_json: bool) -> int:
    """Print what there is of ``kind``, or of every kind; return the exit status, which is 0.

    Raises InputError for an unknown kind.
    """
    every = (*KINDS, RUNS)
    if kind is not None and kind not in every:
        raise InputError(f"list {kind}: allowed: {', '.join(every)}{did_you_mean(kind, every)}")
    found = {one: items(one) for one in ((kind,) if kind else every)}
    if as_json:
        told = {one: [item._asdict() for item in there] for one, there in found.items()}
        sys.stdout.write(json.dumps(told) + "\n")
        return 0
    for number, (one, there) in enumerate(found.items()):
        sys.stdout.write("\n" * bool(number) + f"{one}\n")
        if not there:
            sys.stdout.write("  none\n")
        for line in _lines(there):
            sys.stdout.write(line + "\n")
    return 0


def _lines(there: list[Item]) -> list[str]:
    """Return the items, one in a line; in a terminal a long description continues below its beginning."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
    wide = max((len(item.name) for item in there), default=0)
    found = []
    for name, description in there:
        room = width - wide - 4
        rows = textwrap.wrap(description, room) if _LEAST_ROOM < room < len(description) else [description]
        found += [f"  {(name if not k else ''):{wide}}  {row}".rstrip() for k, row in enumerate(rows or [""])]
    return found


def create(path: Path, like: str, kind: str) -> int:
    """Write a copy of a file, to be edited, to ``path``; print the command that uses it, and return 0.

    The copy keeps the comments. Its name is that of the file, and its schema is found by editors wherever the
    copy lies. Raises InputError if ``path`` exists or cannot be written, or for an unknown ``like`` or kind.
    """
    if kind not in _ONE:
        raise InputError(f"--kind {kind}: allowed: {', '.join(_ONE)}{did_you_mean(kind, _ONE)}")
    text = find(_ONE[kind], like).read_text(encoding="utf-8")
    schema = config_root() / "schemas" / f"{kind}.json"
    head = f"# yaml-language-server: $schema={schema}"
    text = re.sub(r"^# yaml-language-server:.*$", lambda _: head, text, count=1, flags=re.MULTILINE)
    if not text.startswith("# yaml-language-server:"):
        text = f"{head}\n{text}"
    name = re.sub(r"[^A-Za-z0-9._-]", "-", path.stem)
    if kind != "companion":
        text = re.sub(r"^name:.*$", f"name: {name}", text, count=1, flags=re.MULTILINE)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(f"{path}: exists; allowed: a new file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    sys.stdout.write(f"{path}: a copy of {like}; {_next(kind, path)}\n")
    return 0


def _next(kind: str, path: Path) -> str:
    """Return what to do with the copy."""
    shown = str(path) if path.suffix in (".yaml", ".yml") else f"./{path}"
    return {
        "scenario": f"fly it with: outrider swarm {shown}",
        "sweep": f"fly it with: outrider sweep {shown}",
        "scene": "name it in a sweep",
        "vehicle": f"name it in a scenario, or fly it with: outrider sitl --vehicle {shown}",
        "camera": f"use it with: outrider sitl --camera {shown}",
        "companion": f"fly it with: outrider fly --config {shown} …",
    }[kind]
