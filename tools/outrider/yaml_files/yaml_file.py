"""Loader from a YAML file to a typed, checked, frozen value: bytes → text → tree → model.

All faults of a file are reported at once, one line each: place, what is allowed, and the nearest valid word.
Types are strict: text never becomes a number, nor a number text.
"""

from __future__ import annotations

import json
import sys
from bisect import bisect_right
from functools import lru_cache
from pathlib import Path
from typing import Protocol, Self, TypeVar, runtime_checkable

from pydantic import BaseModel, ValidationError

from outrider.errors import Fault, InputError
from outrider.suggestions import neighbours
from outrider.yaml_files.model_faults import model_flaws
from outrider.yaml_files.renamed_keys import present_names
from outrider.yaml_files.schema_nodes import Schema, listing
from outrider.yaml_files.tree import Flaw, Mapping, parse, plain

Model = TypeVar("Model", bound=BaseModel)


@runtime_checkable
class NamesFiles(Protocol):
    """Model that may name further files."""

    def with_files(self, folder: Path) -> Self:
        """Return the model with the contents of the files that it names, relative to ``folder``."""


MOST_BYTES = 1 << 20
MOST_FAULTS = 100
"""Largest number of faults that are shown; the rest is counted."""
MOST_WORDING = 1000
"""Largest number of characters about one fault, which may quote the file."""


def load(path: Path, model: type[Model]) -> Model:
    """Load the file at ``path`` as a ``model``, with the files that it names.

    Raises InputError with every fault of the file, or of one that it names.
    """
    found = read(_bytes_of(path), str(path), model)
    return found.with_files(path.parent) if isinstance(found, NamesFiles) else found


def read(data: bytes, name: str, model: type[Model]) -> Model:
    """Read ``data`` as a ``model``; faults are reported under ``name``.

    ``model`` must have a JSON Schema, and must forbid extra keys if unknown keys shall be faults. Raises
    InputError with every fault.
    """
    text = _decode(data, name)
    schema = _schema(model)
    tree, flaws = parse(text)
    if tree is None and flaws:
        raise _input_error(text, name, flaws)
    if not isinstance(tree, Mapping):
        wrong = Flaw(0, "is empty") if tree is None else Flaw(tree.at, "is no mapping")
        raise _input_error(text, name, [*flaws, Flaw(wrong.at, f"{wrong.what}; needed: {schema.describe()}")])
    tree, remarks, more = present_names(tree, schema)
    flaws = [*flaws, *more]
    for line in () if flaws else str(_input_error(text, name, remarks)).splitlines():
        _remark(line)
    # Strict mode accepts a list for a tuple, and a text for an enumeration, only from JSON.
    document = json.dumps(plain(tree), allow_nan=False)
    try:
        value = model.model_validate_json(document, strict=True)
    except ValidationError as error:
        found = model_flaws(tree, schema, error.errors(include_url=False, include_input=False))
        raise _input_error(text, name, flaws + found) from None
    if flaws:
        raise _input_error(text, name, flaws)
    return value


@lru_cache(maxsize=256)
def _remark(line: str) -> None:
    """Print ``line`` on standard error, once in a process."""
    sys.stderr.write(f"outrider: {line}\n")


@lru_cache(maxsize=32)
def _schema(model: type[BaseModel]) -> Schema:
    """Return the schema of ``model``; making it takes ten times as long as reading a file with it."""
    written = model.model_json_schema()
    return Schema(written, written)


def _bytes_of(path: Path) -> bytes:
    try:
        if not path.exists():
            near = neighbours(path)
            there = f"; there is {listing(near)}" if near else ""
            folder = "" if path.parent.is_dir() else f", nor a folder {path.parent}"
            raise InputError(Fault(str(path), f"no such file{folder}{there}"))
        if not path.is_file():
            raise InputError(Fault(str(path), "not a file; allowed: a YAML file"))
        with path.open("rb") as file:
            return file.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputError(Fault(str(path), f"cannot be read: {error.strerror}")) from None
    except ValueError:
        raise InputError(Fault(str(path), "not a file name")) from None


def _decode(data: bytes, name: str) -> str:
    if len(data) > MOST_BYTES:
        raise InputError(Fault(name, f"larger than {MOST_BYTES} bytes, the most allowed"))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # The codec's positions do not include the byte order mark.
        data = data.removeprefix(b"\xef\xbb\xbf")
        before = data[: error.start].decode(errors="replace")
        wrong = f"byte 0x{data[error.start]:02x} is not UTF-8; allowed: text in UTF-8"
        raise _input_error(before + "\ufffd", name, [Flaw(len(before), wrong)]) from None


def _input_error(text: str, name: str, flaws: list[Flaw]) -> InputError:
    """Return an error with every flaw once, in the order of the file, each at its line and column."""
    starts = [0, *(at + 1 for at, character in enumerate(text) if character == "\n")]
    end = len(text.rstrip())
    faults = []
    for flaw in sorted(set(flaws))[:MOST_FAULTS]:
        at = min(flaw.at, end)
        line = bisect_right(starts, at)
        what = flaw.what if len(flaw.what) <= MOST_WORDING else flaw.what[: MOST_WORDING - 1] + "…"
        faults.append(Fault(name, what, line, at - starts[line - 1] + 1))
    more = len(set(flaws)) - MOST_FAULTS
    if more > 0:
        faults.append(Fault(name, f"and {more} more faults"))
    return InputError(*faults)
