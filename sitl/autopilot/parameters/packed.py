"""Parameters as one file: ArduPilot's ``@PARAM/param.pck``, and PX4's metadata of parameters.

Format of the packed file (ArduPilot, AP_Filesystem_Param): a header of three little-endian uint16, magic,
number of parameters in the file, and of all; then for each parameter a byte with its type (1, 2, 3: int8,
int16, int32; 4: float) and in bit 4 whether the default follows; a byte with the number of characters shared
with the name before and, in the upper half, that of the others less one; these characters; the value; the
default if it differs.
"""

from __future__ import annotations

import math
from struct import Struct
from typing import Final

from sitl.autopilot.parameters.parameter import Kind
from sitl.autopilot.parameters.values import Values

_HEADER: Final = Struct("<HHH")
_MAGIC, _MAGIC_DEFAULTS = 0x671B, 0x671C
_LAYOUTS: Final = {
    Kind.INT8: (1, Struct("<b")),
    Kind.INT16: (2, Struct("<h")),
    Kind.INT32: (3, Struct("<i")),
    Kind.REAL32: (4, Struct("<f")),
}
_MOST_SHARED: Final = 15
_DEFAULT_FOLLOWS: Final = 0x10


def packed(values: Values, *, defaults: bool, start: int = 0, count: int | None = None) -> bytes:
    """Return ``count`` parameters (None: all) from the number ``start`` on, as the packed file.

    The names are sorted, as neighbours then share their beginnings. ``defaults`` adds the defaults.
    """
    order = sorted(range(len(values)), key=lambda number: values.table[number].name)
    chosen = order[start:] if count is None else order[start : start + count]
    pieces = [_HEADER.pack(_MAGIC_DEFAULTS if defaults else _MAGIC, len(chosen), len(values))]
    before = ""
    for number in chosen:
        parameter, value = values.table[number], values.value(number)
        code, layout = _LAYOUTS[parameter.kind]
        name, shared = parameter.name, 0
        while shared < min(len(before), len(name) - 1, _MOST_SHARED) and before[shared] == name[shared]:
            shared += 1
        # ``set`` bounds a value by its type, so the struct takes it.
        data = layout.pack(value if parameter.kind is Kind.REAL32 else int(value))
        initial = values.initial(number)
        if defaults and initial != value:
            code |= _DEFAULT_FOLLOWS
            data += layout.pack(initial if parameter.kind is Kind.REAL32 else int(initial))
        pieces.append(bytes((code, shared | len(name) - shared - 1 << 4)) + name[shared:].encode() + data)
        before = name
    return b"".join(pieces)


def described(values: Values) -> dict[str, object]:
    """Return the parameters as MAVLink's component metadata (parameter.schema.json) describes them."""
    parameters = []
    for number, parameter in enumerate(values.table):
        said: dict[str, object] = {
            "name": parameter.name,
            "type": {Kind.REAL32: "Float"}.get(parameter.kind, parameter.kind.name.capitalize()),
            "default": values.initial(number),
        }
        if math.isfinite(parameter.low):
            said["min"] = parameter.low
        if math.isfinite(parameter.high):
            said["max"] = parameter.high
        if parameter.unit:
            said["units"] = parameter.unit
        parameters.append(said)
    return {"version": 1, "parameters": parameters}
