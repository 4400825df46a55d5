"""MCAP file of JSON messages: a schema for every channel, chunks with checksums, an index and a summary."""

from __future__ import annotations

import json
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NamedTuple, Self

from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer

from outrider.export.json_schema import Schema


class Entry(NamedTuple):
    """Message: its time (Unix µs), its channel, the schema of the channel, and the JSON data."""

    time: int
    topic: str
    schema: Schema
    data: bytes


def entry(time: int, topic: str, schema: Schema, value: dict[str, Any]) -> Entry:
    """Return an entry with ``value`` as JSON. Raises ValueError if ``value`` contains NaN or infinity."""
    return Entry(time, topic, schema, json.dumps(value, separators=(",", ":"), allow_nan=False).encode())


class McapFile:
    """Writer of the MCAP file at ``path``, as a context manager.

    The file is finished only if no error occurred. The same entries give the same bytes.
    """

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
        """Number of channels so far."""
        return len(self._channels)

    def attach(self, name: str, kind: str, time: int, data: bytes) -> None:
        """Attach a whole file, such as the configuration of the run; ``time`` in Unix µs."""
        self._writer.add_attachment(0, time * 1000, name, kind, data)

    def write(self, one: Entry) -> None:
        """Write a message, and open its channel if it is the first of that channel."""
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
