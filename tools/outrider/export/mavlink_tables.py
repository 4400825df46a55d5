"""The tables of logs: one for each system and type of message, ``mavlink/SYSTEM/NAME``.

Values are raw, as MAVLink has them, and the unit stands in the column's name where the dialect knows it
(``lat [degE7]``). An array is a column for each item (``q[0]``), bytes are hexadecimal.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from struct import Struct
from typing import Final

import numpy as np
from numpy.typing import NDArray

from outrider.export.table_files import Column, Part
from outrider.logs.dialect import Field, Kind, text
from outrider.logs.message_stream import Spoken

HEAD: Final = ("time_us", "log", "link", "system", "component")
"""Columns before the fields: Unix µs, the vehicle whose log it is (0 for a log of no run), the link (0…3),
who said it."""
_HEAD = Struct("<qBBBB")
_HEAD_TYPES = [("time_us", "<i8"), ("log", "u1"), ("link", "u1"), ("system", "u1"), ("component", "u1")]
_ROWS: Final = 32_768
_BYTES: Final = 32 << 20
"""What waits in all tables together before it is written."""


class Heap:
    """Messages that wait until they are worth writing, as they were on the wire: a small part of what they
    would take as values."""

    def __init__(self) -> None:
        self._waiting: dict[tuple[int, Kind], list[bytes]] = defaultdict(list)
        self._bytes = 0

    def add(self, owner: int, spoken: Spoken) -> Iterator[Part]:
        """Take it in; what is then due to be written."""
        key = spoken.system, spoken.kind
        rows = self._waiting[key]
        row = _HEAD.pack(spoken.time, owner, spoken.link, spoken.system, spoken.component) + spoken.payload
        rows.append(row)
        self._bytes += len(row)
        if self._bytes >= _BYTES:
            yield from self.rest()
        elif len(rows) >= _ROWS:
            self._bytes -= sum(map(len, rows))
            yield _part(*key, self._waiting.pop(key))

    def rest(self) -> Iterator[Part]:
        """All that waits."""
        waiting, self._waiting, self._bytes = self._waiting, defaultdict(list), 0
        for (system, kind), rows in waiting.items():
            yield _part(system, kind, rows)


def parts(logs: Iterable[tuple[int, Iterable[Spoken]]]) -> Iterator[Part]:
    """Of logs, each with its owner, one after the other."""
    heap = Heap()
    for owner, messages in logs:
        for spoken in messages:
            yield from heap.add(owner, spoken)
    yield from heap.rest()


def _part(system: int, kind: Kind, rows: list[bytes]) -> Part:
    records = np.frombuffer(
        b"".join(rows), dtype=np.dtype(_HEAD_TYPES + [field.numpy for field in kind.wire])
    )
    found: dict[str, Column] = {name: np.ascontiguousarray(records[name]) for name in HEAD}
    for field in kind.fields:
        found |= columns(field, records[field.name])
    return Part(f"mavlink/{system}/{kind.name}", found)


def columns(field: Field, values: NDArray[np.generic]) -> dict[str, Column]:
    """The columns of a field (n,) or (n, count)."""
    unit = f" [{field.unit}]" if field.unit else ""
    if field.is_text:
        return {field.name: [text(raw) for raw in values.tolist()]}
    if field.is_bytes:
        return {field.name: [row.tobytes().hex() for row in values]}
    if field.length:
        return {f"{field.name}[{k}]{unit}": np.ascontiguousarray(values[:, k]) for k in range(field.length)}
    return {f"{field.name}{unit}": np.ascontiguousarray(values)}
