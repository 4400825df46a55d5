"""Definition of each message in pymavlink's dialect: its fields, their places in a payload, their units."""

from __future__ import annotations

from functools import cache, cached_property
from struct import Struct
from typing import Any, Final, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

_CODES: Final = {
    "int8_t": "b",
    "uint8_t": "B",
    "int16_t": "h",
    "uint16_t": "H",
    "int32_t": "i",
    "uint32_t": "I",
    "int64_t": "q",
    "uint64_t": "Q",
    "float": "f",
    "double": "d",
}


class Field(NamedTuple):
    """A field as the dialect defines it.

    ``length``: of an array, 0 for a single value; ``unit`` is MAVLink's own word (``degE7``, ``cm/s``), empty
    where it has none.
    """

    name: str
    type: str
    length: int
    unit: str
    enum: str

    @property
    def is_text(self) -> bool:
        """Whether the field is text, which ends at the first NUL."""
        return self.type == "char"

    @property
    def is_bytes(self) -> bool:
        """Whether the field is an array of bytes without unit: a payload, an id."""
        return self.type == "uint8_t" and self.length > 0 and not self.unit

    @property
    def is_float(self) -> bool:
        """Whether the field may hold a NaN."""
        return self.type in ("float", "double")

    @property
    def code(self) -> str:
        """Format of the field for ``struct``."""
        if self.is_text:
            return f"{max(self.length, 1)}s"
        return f"{self.length or ''}{_CODES[self.type]}"

    @property
    def numpy(self) -> tuple[str, str] | tuple[str, str, tuple[int]]:
        """Entry of the field in a structured dtype."""
        if self.is_text:
            return self.name, f"S{max(self.length, 1)}"
        one = self.name, f"<{_CODES[self.type]}"
        return (*one, (self.length,)) if self.length else one


class Kind:
    """One type of message: ``fields`` in the order of its definition, ``wire`` in that of the payload."""

    def __init__(self, definition: Any) -> None:
        self.id: int = definition.id
        self.name: str = definition.msgname
        types = dict(zip(definition.fieldnames, definition.fieldtypes, strict=True))
        units, enums = definition.fieldunits_by_name, definition.fieldenums_by_name
        self.wire = tuple(
            Field(name, types[name], count, units.get(name, ""), enums.get(name, ""))
            for name, count in zip(definition.ordered_fieldnames, definition.array_lengths, strict=True)
        )
        by_name = {field.name: field for field in self.wire}
        self.fields = tuple(by_name[name] for name in definition.fieldnames)
        self._struct = Struct("<" + "".join(field.code for field in self.wire))
        self.size = self._struct.size

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """Structured dtype of complete payloads, one after the other."""
        return np.dtype([field.numpy for field in self.wire])

    def whole(self, payload: bytes) -> bytes:
        """Return a payload of full size.

        The zeros that MAVLink 2 cuts off, and the extensions that MAVLink 1 lacks, are added; fields that a
        newer dialect has added at the end are removed.
        """
        size = self.size
        return payload if len(payload) == size else payload.ljust(size, b"\0")[:size]

    def read(self, payload: bytes) -> dict[str, Any]:
        """Return the values of a complete payload by name, in the order of ``wire``.

        Text is returned as str, bytes as bytes, other arrays as tuples.
        """
        parts = self._struct.unpack(payload)
        result: dict[str, Any] = {}
        at = 0
        for field in self.wire:
            if field.is_text:
                result[field.name] = text(parts[at])
                at += 1
            elif field.length:
                array = parts[at : at + field.length]
                result[field.name] = bytes(array) if field.is_bytes else array
                at += field.length
            else:
                result[field.name] = parts[at]
                at += 1
        return result


def text(raw: bytes) -> str:
    """Decode ``raw`` up to the first NUL; bytes that are not UTF-8 are replaced."""
    return raw.partition(b"\0")[0].decode("utf-8", "replace")


@cache
def kind(identifier: int) -> Kind:
    """Return the type of message with this id; raise KeyError if the dialect lacks it."""
    return Kind(mavlink.mavlink_map[identifier])


def identifiers() -> list[int]:
    """Return the ids of all types of messages in the dialect."""
    return sorted(mavlink.mavlink_map)
