"""ULog writer, after the public specification.

The specification is https://docs.px4.io/main/en/dev_log/ulog_file_format.html. A file has a header, flag
bits, information and formats; then subscriptions, data and texts. Numbers are little-endian, times in µs.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import Final, NamedTuple, Self

from outrider.errors import OutriderError

MAGIC: Final = b"ULog\x01\x12\x35\x01"
"""First eight bytes of the header; the last of them is the version of the format."""
MOST_INSTANCES: Final = 256
_HEADER = Struct("<HB")
_FLAGS = bytes(40)
"""Flag bits: no feature that a reader must support, and no appended data."""
_SUBSCRIBE = Struct("<BH")
_DATA = Struct("<HQ")
_TEXT = Struct("<BQ")


class Topic(NamedTuple):
    """Message format: its name, and its ``fields`` (type, name) after the time stamp of every message."""

    name: str
    fields: tuple[tuple[str, str], ...]

    @property
    def format(self) -> str:
        """Format definition as written to the file."""
        fields = (("uint64_t", "timestamp"), *self.fields)
        return f"{self.name}:" + "".join(f"{kind} {name};" for kind, name in fields)


class UlogFile:
    """Writer of the ULog at ``path``; a context manager. The same calls give the same bytes.

    ``start`` is the time of the log's start in µs; ``topics`` lists all topics that may be written.
    """

    def __init__(
        self, path: Path, start: int, information: dict[str, str | int], topics: Iterable[Topic]
    ) -> None:
        self.messages = 0
        self.out_of_order = 0
        self._subscriptions: dict[tuple[str, object], int] = {}
        self._instances: dict[str, int] = defaultdict(int)
        self._latest: list[int] = []
        self._file = path.open("wb")
        self._file.write(MAGIC + start.to_bytes(8, "little"))
        self._write("B", _FLAGS)
        for name, value in information.items():
            self._inform(name, value)
        for topic in topics:
            self._write("F", topic.format.encode())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    @property
    def subscriptions(self) -> int:
        """Number of subscriptions so far."""
        return len(self._subscriptions)

    def data(self, time: int, topic: Topic, source: object, values: bytes) -> None:
        """Write a message of ``topic``; each ``source`` has an instance of its own.

        A message earlier than the last written one of its topic and source is omitted and counted, because a
        series must not go back in time. Raises OutriderError for the 257th source of a topic.
        """
        key = topic.name, source
        number = self._subscriptions.get(key)
        if number is None:
            number = self._subscribe(topic, key)
        if time < self._latest[number]:
            self.out_of_order += 1
            return
        self._latest[number] = time
        self._write("D", _DATA.pack(number, time) + values)
        self.messages += 1

    def say(self, time: int, severity: int, text: str) -> None:
        """Write a text; ``severity`` 0…7 is MAVLink's, which equals that of the Linux kernel."""
        self._write("L", _TEXT.pack(ord("0") + min(severity, 7), time) + text.encode())

    def _subscribe(self, topic: Topic, key: tuple[str, object]) -> int:
        instance = self._instances[topic.name]
        if instance >= MOST_INSTANCES:
            raise OutriderError(f"{topic.name}: a ULog has room for {MOST_INSTANCES} senders")
        self._instances[topic.name] += 1
        number = len(self._subscriptions)
        self._subscriptions[key] = number
        self._latest.append(0)
        self._write("A", _SUBSCRIBE.pack(instance, number) + topic.name.encode())
        return number

    def _inform(self, name: str, value: str | int) -> None:
        if isinstance(value, int):
            key, raw = f"uint64_t {name}", value.to_bytes(8, "little")
        else:
            raw = value.encode()
            key = f"char[{len(raw)}] {name}"
        self._write("I", bytes([len(key)]) + key.encode() + raw)

    def _write(self, kind: str, body: bytes) -> None:
        self._file.write(_HEADER.pack(len(body), ord(kind)) + body)
