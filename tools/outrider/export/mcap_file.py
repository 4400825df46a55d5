"""An MCAP of JSON messages: a schema on every channel, chunks with checksums, an index and a summary at the
end."""

from __future__ import annotations

import json
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NamedTuple, Self

from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer

from outrider.export.json_schema import Schema


class Entry(NamedTuple):
    """A message: when (Unix µs), on which channel, and its JSON."""

    time: int
    topic: str
    schema: Schema
    data: bytes


def entry(time: int, topic: str, schema: Schema, value: dict[str, Any]) -> Entry:
    """Of a value without NaN. Raises ValueError for one."""
    return Entry(time, topic, schema, json.dumps(value, separators=(",", ":"), allow_nan=False).encode())


class McapFile:
    """Writes the file at ``path``; a context manager that finishes it only if all went well. Same entries,
    same bytes."""

    def __init__(self, path: Path) -> None:
        self.messages = 0
        self._file: IO[bytes] = path.open("wb")
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(library=f"outrider {LIBRARY_IDENTIFIER}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None:
                self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._file.close()

    @property
    def channels(self) -> int:
        """How many there are so far."""
        return len(self._channels)

    def attach(self, name: str, kind: str, time: int, data: bytes) -> None:
        """A whole file beside the messages, such as the configuration of the run."""
        self._writer.add_attachment(0, time * 1000, name, kind, data)

    def write(self, one: Entry) -> None:
        """A message; its channel is opened when it is the first."""
        channel = self._channels.get(one.topic)
        if channel is None:
            channel = self._open(one.topic, one.schema)
        time = one.time * 1000
        self._writer.add_message(channel, time, one.data, time)
        self.messages += 1

    def _open(self, topic: str, schema: Schema) -> int:
        known = self._schemas.get(schema.name)
        if known is None:
            known = self._writer.register_schema(schema.name, "jsonschema", schema.data)
            self._schemas[schema.name] = known
        channel = self._writer.register_channel(topic, "json", known)
        self._channels[topic] = channel
        return channel
