"""Declaration of a MAVLink message: one class, with the conversion of its fields to a payload and back.

``message`` is the decorator of these classes. pymavlink's generated dialect gives ids, CRC_EXTRA, field order
and struct; the class has the SI values. Importing the package ``messages`` fills the tables ``BY_ID`` and
``BY_TYPE`` with all messages.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from math import isfinite
from numbers import Real
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import Any, NamedTuple, Protocol, TypeVar

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages.fields import Fields
from mavlink_bridge.messages.source import Source

_CODE = re.compile(r"\d*[a-zA-Z]")
"""One code of a struct's layout, with its count."""


class Message(Protocol):
    """Any declared message: a frozen tuple of its source and its values."""

    @property
    def source(self) -> Source:
        """Sender of the message."""

    @property
    def _fields(self) -> tuple[str, ...]: ...

    @property
    def _replace(self) -> Callable[..., Any]: ...

    def __iter__(self) -> Iterator[Any]: ...


class Converter(NamedTuple):
    """Conversion of one message to its payload and back.

    ``decode`` builds a message from the fields in wire order, or returns None if a field is invalid;
    ``encode`` is the reverse. ``finite``: if True, a NaN or infinity in any field is an error; if False, it
    is kept, as it may mean *ignored* or *unknown*. ``size_v1``: payload bytes without extension fields.
    """

    message: type[Message]
    id: int
    name: str
    crc_extra: bytes
    struct: Struct
    size_v1: int
    field_names: tuple[str, ...]
    decode: Callable[[Source, Fields], Message | None]
    encode: Callable[[Any], Fields]
    finite: bool

    def parse(self, source: Source, payload: bytes) -> Message | None:
        """Decode a payload of any length (it is padded with zeros, or cut); return None if it is invalid."""
        size = self.struct.size
        fields = self.struct.unpack(payload[:size] if len(payload) >= size else payload.ljust(size, b"\0"))
        if self.finite and not isfinite(sum(fields)):
            return None
        return self.decode(source, fields)

    def pack(self, message: Message) -> bytes:
        """Encode ``message`` as a full payload; raise EncodeError with field and value if it does not fit."""
        try:
            fields = self.encode(message)
            if self.finite and not isfinite(sum(fields)):
                raise ValueError
            return self.struct.pack(*fields)
        except (ValueError, OverflowError, StructError):
            raise self._encode_error(message) from None

    def _encode_error(self, message: Message) -> EncodeError:
        if self.finite:
            for name, value in zip(message._fields, message, strict=True):
                for number in value if isinstance(value, Iterable) else (value,):
                    if isinstance(number, Real) and not isfinite(number):
                        return EncodeError(f"{self.name}: {name} = {number} is not finite")
        codes = _CODE.findall(self.struct.format)
        try:
            values = self.encode(message)
        except (OverflowError, ValueError) as error:
            return EncodeError(f"{self.name}: {message} has no value on the wire: {error}")
        for name, code, value in zip(self.field_names, codes, values, strict=True):
            try:
                Struct("<" + code).pack(value)
            except (OverflowError, StructError):
                return EncodeError(f"{self.name}: {name} = {value} does not fit its field")
        return EncodeError(f"{self.name}: {message} cannot be packed")


class Definition(NamedTuple):
    """Definition of a message that the dialect lacks: id, CRC_EXTRA, and struct and fields in wire order."""

    id: int
    crc_extra: int
    layout: str
    fields: tuple[str, ...]


BY_ID: dict[int, Converter] = {}
BY_TYPE: dict[type[Message], Converter] = {}

M = TypeVar("M", bound=type[Message])


def message(
    name: str,
    *,
    finite: bool = False,
    size_v1: int | None = None,
    layout: str | None = None,
    more: tuple[str, ...] = (),
    definition: Definition | None = None,
) -> Callable[[M], M]:
    """Return the decorator that declares a NamedTuple class as the values of the MAVLink message ``name``.

    The class may define ``decode(source, fields)``, a static method that returns a message, or None if a
    field is invalid, and ``encode()``, which returns the fields or raises EncodeError. By default the values
    are the fields unchanged: in wire order, in MAVLink's units.

    ``finite`` is as in ``Converter``. ``size_v1`` is required where there are extension fields: the generated
    classes do not mark them. ``layout`` replaces the dialect's, with ``more`` extension fields that the
    dialect lacks. ``definition`` is that of a message that the dialect lacks. Raises AttributeError for a
    name that has neither.
    """

    def declare(kind: M) -> M:
        if definition is None:
            number: int = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
            generated = mavlink.mavlink_map[number]
            crc, fields = generated.crc_extra, tuple(generated.ordered_fieldnames)
            codes = _codes(layout or generated.unpacker.format)
        else:
            number, crc, codes, fields = *definition[:2], _codes(definition.layout), definition.fields
        struct = Struct("<" + "".join(codes))
        names = zip((*fields, *more), codes, strict=True)
        converter = Converter(
            kind,
            number,
            name,
            bytes((crc,)),
            struct,
            struct.size if size_v1 is None else size_v1,
            tuple(field for field, code in names for _ in _CODE.findall(code)),
            getattr(kind, "decode", partial(_as_sent, kind)),
            getattr(kind, "encode", _as_they_are),
            finite,
        )
        BY_ID[number] = BY_TYPE[kind] = converter
        return kind

    return declare


def _as_sent(kind: Callable[..., Message], source: Source, fields: Fields) -> Message:
    return kind(source, *fields)


def _as_they_are(values: tuple[Any, ...]) -> Fields:
    return tuple(values[1:])


def _codes(layout: str) -> list[str]:
    """Return for each field of ``layout`` its struct codes, one code for each value.

    ``4f`` becomes ``ffff``, four values. ``16s`` is one value of 16 bytes, and so is ``16B``.
    """
    fields = _CODE.findall(re.sub(r"(\d+)B", r"\1s", layout))
    return [field if field.endswith("s") else field[-1] * int(field[:-1] or 1) for field in fields]
