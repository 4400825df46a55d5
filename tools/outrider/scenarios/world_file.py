"""World files: sets of boxes as tables of comma-separated values.

A row is ``x,y,z,sx,sy,sz`` or ``x,y,z,sx,sy,sz,yaw_deg``: centre and size, m, and the angle of ``Box``. These
names may be the first line. Empty lines and lines that begin with ``#`` are left out. Faults have their lines
and columns.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field

from companion.config.obstacles import MOST_OBSTACLES, Box, Obstacle
from outrider.errors import Fault, InputError

WORLD = (
    "file of boxes, relative to this file: a CSV table x,y,z,sx,sy,sz[,yaw_deg], which are added to obstacles"
)
WorldName = Annotated[str, Field(min_length=1, max_length=4096)]
COLUMNS = ("x", "y", "z", "sx", "sy", "sz", "yaw_deg")
_MOST_BYTES = 1 << 22
_MOST_FAULTS = 20
_FEWEST = 6
_LISTED = 100
"""Boxes from which on a run directory has them in a file of their own."""
_FILE = "world.csv"


class _Range(NamedTuple):
    """Allowed numbers: from ``least`` to ``most``, or more than ``least`` if ``above``."""

    least: float
    most: float
    above: bool = False

    def __str__(self) -> str:
        return f"{'more than ' if self.above else ''}{self.least:g} to {self.most:g}"

    def holds(self, value: float) -> bool:
        return (self.least < value if self.above else self.least <= value) and value <= self.most


_PLACE, _SIZE, _ANGLE = _Range(-10_000.0, 10_000.0), _Range(0.0, 1000.0, above=True), _Range(-360.0, 360.0)
_RANGES = (_PLACE,) * 3 + (_SIZE,) * 3 + (_ANGLE,)


class _Cell(NamedTuple):
    """Text of one cell, without the spaces around it, at a ``column`` that counts from 1."""

    text: str
    column: int


def with_world(obstacles: tuple[Obstacle, ...], world: str | None, folder: Path) -> tuple[Obstacle, ...]:
    """Return ``obstacles`` and the boxes of the file ``world`` in ``folder``, if one is named.

    Raises InputError as ``read_world`` does, and if there are too many.
    """
    if world is None:
        return obstacles
    path = folder / world
    found = (*obstacles, *read_world(path))
    if len(found) > MOST_OBSTACLES:
        raise InputError(
            Fault(str(path), f"with obstacles these are {len(found)}; allowed: at most {MOST_OBSTACLES}")
        )
    return found


def read_world(path: Path) -> tuple[Box, ...]:
    """Return the boxes of the world file at ``path``; raise InputError with its faults."""
    try:
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise InputError(Fault(str(path), f"cannot be read: {error.strerror}")) from None
    except ValueError:
        raise InputError(Fault(str(path), "not a file name")) from None
    return boxes_of(data, str(path))


def boxes_of(data: bytes, name: str) -> tuple[Box, ...]:
    """Return the boxes of a world file's ``data``; faults are reported under ``name``."""
    if len(data) > _MOST_BYTES:
        raise InputError(Fault(name, f"larger than {_MOST_BYTES} bytes, the most allowed"))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].split(b"\n")
        what = f"byte 0x{data[error.start]:02x} is not UTF-8; allowed: a table of numbers"
        raise InputError(Fault(name, what, len(before), len(before[-1]) + 1)) from None
    boxes: list[Box] = []
    faults: list[Fault] = []
    first = True
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        cells = _cells(line)
        found = list(_faults_of_header(cells) if first and _heads(cells) else _faults_of_row(cells))
        faults += [Fault(name, what, number, column) for column, what in found]
        if not found and not (first and _heads(cells)):
            x, y, z, sx, sy, sz, yaw = (*(float(cell.text) for cell in cells), 0.0)[:7]
            boxes.append(Box(kind="box", at=(x, y, z), size=(sx, sy, sz), yaw_deg=yaw))
        first = False
        if len(faults) > _MOST_FAULTS:
            raise InputError(*faults[:_MOST_FAULTS], Fault(name, "and more faults"))
        if len(boxes) > MOST_OBSTACLES:
            raise InputError(Fault(name, f"more than {MOST_OBSTACLES} boxes, the most allowed", number, 1))
    if faults:
        raise InputError(*faults)
    return tuple(boxes)


def write_world(path: Path, boxes: Sequence[Box]) -> None:
    """Write ``boxes`` to the world file ``path``; ``read_world`` returns the same. Raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        table.writerows((*box.at, *box.size, box.yaw_deg) for box in boxes)


def beside(obstacles: tuple[Obstacle, ...], folder: Path) -> tuple[tuple[Obstacle, ...], str | None]:
    """Return what the configuration in ``folder`` states of ``obstacles``: a list, and the name of a file.

    If they end with more than a hundred boxes, those are written to a file there, because a list of thousands
    takes long to read. Raises OSError if it cannot be written.
    """
    count = len(obstacles)
    while count and isinstance(obstacles[count - 1], Box):
        count -= 1
    boxes = [one for one in obstacles[count:] if isinstance(one, Box)]
    if len(boxes) <= _LISTED:
        return obstacles, None
    write_world(folder / _FILE, boxes)
    return obstacles[:count], _FILE


def _cells(line: str) -> list[_Cell]:
    found, at = [], 0
    for text in line.split(","):
        found.append(_Cell(text.strip(), at + len(text) - len(text.lstrip()) + 1))
        at += len(text) + 1
    return found


def _heads(cells: list[_Cell]) -> bool:
    """Return whether the first line of a table is a header: words, and no number."""
    return all(cell.text and _number(cell.text) is None for cell in cells)


def _faults_of_header(cells: list[_Cell]) -> Iterator[tuple[int, str]]:
    names = tuple(cell.text.lower() for cell in cells)
    if names not in (COLUMNS, COLUMNS[:_FEWEST]):
        wrong = next(
            (k for k, pair in enumerate(zip(names, COLUMNS, strict=False)) if pair[0] != pair[1]), -1
        )
        yield (
            cells[wrong].column,
            f"the header is {','.join(names)}; allowed: {','.join(COLUMNS[:_FEWEST])} or {','.join(COLUMNS)}",
        )


def _faults_of_row(cells: list[_Cell]) -> Iterator[tuple[int, str]]:
    if not _FEWEST <= len(cells) <= len(COLUMNS):
        extra = cells[min(len(cells) - 1, len(COLUMNS))]
        columns = f"{','.join(COLUMNS[:_FEWEST])}[,{COLUMNS[-1]}]"
        yield extra.column, f"{len(cells)} columns; allowed: {_FEWEST} or {len(COLUMNS)}, {columns}"
        return
    for name, cell, allowed in zip(COLUMNS, cells, _RANGES, strict=False):
        value = _number(cell.text)
        if not cell.text:
            yield cell.column, f"{name} is missing; allowed: {allowed}"
        elif value is None:
            yield cell.column, f"{name} is {cell.text[:40]!r}, no number; allowed: {allowed}"
        elif not isfinite(value) or not allowed.holds(value):
            yield cell.column, f"{name} is {cell.text[:40]}; allowed: {allowed}"


def _number(text: str) -> float | None:
    """Return the number that ``text`` is; None if it is none. Python's digit separators are not allowed."""
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None
