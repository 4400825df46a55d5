"""Tables of logs: one for each system and message type, ``mavlink/SYSTEM/NAME``.

Values are raw, as in MAVLink; the column name has the unit where the dialect defines it (``lat [degE7]``). An
array has one column for each item (``q[0]``); bytes are hexadecimal.
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
from outrider.logs.message_stream import LogMessage

HEAD: Final = ("utc", "log", "link", "system", "component")
"""Columns before the fields.

They are the time (UTC), the vehicle that recorded the log (0 for a log outside a run), the link (0…3), and
the sender's system and component id.
"""
_HEAD = Struct("<qBBBB")
_HEAD_TYPES = [("utc", "<M8[us]"), ("log", "u1"), ("link", "u1"), ("system", "u1"), ("component", "u1")]
_PART_ROWS: Final = 32_768
_MAX_BUFFER_BYTES: Final = 32 << 20
"""Total size of the buffered rows of all tables at which they are written."""


class Heap:
    """Messages buffered until there are enough to write.

    They are kept as raw bytes, which take a small part of the memory of decoded values.
    """

    def __init__(self) -> None:
        self._waiting: dict[tuple[int, Kind], list[bytes]] = defaultdict(list)
        self._bytes = 0

    def add(self, owner: int, spoken: LogMessage) -> Iterator[Part]:
        """Add a message, and yield the parts that are due to be written."""
        key = spoken.system, spoken.kind
        rows = self._waiting[key]
        row = _HEAD.pack(spoken.time, owner, spoken.link, spoken.system, spoken.component) + spoken.payload
        rows.append(row)
        self._bytes += len(row)
        if self._bytes >= _MAX_BUFFER_BYTES:
            yield from self.rest()
        elif len(rows) >= _PART_ROWS:
            self._bytes -= sum(map(len, rows))
            yield _part(*key, self._waiting.pop(key))

    def rest(self) -> Iterator[Part]:
        """Yield all buffered messages as parts, and empty the buffer."""
        waiting, self._waiting, self._bytes = self._waiting, defaultdict(list), 0
        for (system, kind), rows in waiting.items():
            yield _part(system, kind, rows)


def parts(logs: Iterable[tuple[int, Iterable[LogMessage]]]) -> Iterator[Part]:
    """Yield the tables' parts of ``logs``, pairs of an owner and its messages, one log after the other."""
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
    """Return the columns of a field with values (n,) or (n, count)."""
    unit = f" [{field.unit}]" if field.unit else ""
    if field.is_text:
        return {field.name: [text(raw) for raw in values.tolist()]}
    if field.is_bytes:
        return {field.name: [row.tobytes().hex() for row in values]}
    if field.length:
        return {f"{field.name}[{k}]{unit}": np.ascontiguousarray(values[:, k]) for k in range(field.length)}
    return {f"{field.name}{unit}": np.ascontiguousarray(values)}
