"""Parameter: its name, type, range, effect in the simulation and encoding in PARAM_VALUE (22)."""

from __future__ import annotations

import math
from enum import Enum
from struct import Struct
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

_FLOAT: Final = Struct("<f")
_INT: Final = Struct("<i")
# Messages to people show the value, so an absurd number must stay short.
_SHOWN: Final = "{:.6g}"


class Kind(Enum):
    """MAV_PARAM_TYPE values in use by the firmwares."""

    INT8 = mavlink.MAV_PARAM_TYPE_INT8
    INT16 = mavlink.MAV_PARAM_TYPE_INT16
    INT32 = mavlink.MAV_PARAM_TYPE_INT32
    REAL32 = mavlink.MAV_PARAM_TYPE_REAL32


_BITS: Final = {Kind.INT8: 8, Kind.INT16: 16, Kind.INT32: 32}


class Bound(NamedTuple):
    """Setting of ``AutopilotConfig`` bound to a parameter: value × ``scale``, or one of ``options``.

    ``setting`` may be a member of a group (``fence.height``). A setting that is None leaves the firmware's
    default.
    """

    setting: str
    scale: float = 1.0
    options: tuple[tuple[int, str], ...] = ()


class Parameter(NamedTuple):
    """One parameter of a firmware.

    ``default`` is the firmware's own; a ``bound`` parameter starts with the value of its setting. ``low`` and
    ``high`` are inclusive and in ``unit``, infinite where the firmware gives no range.
    """

    name: str
    kind: Kind
    default: float
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    bound: Bound | None = None

    def fitted(self, value: float) -> float:
        """Return ``value`` as the type stores it: float32, or the nearest whole number."""
        return float(_FLOAT.unpack(_FLOAT.pack(value))[0]) if self.kind is Kind.REAL32 else round(value)

    def refusal(self, value: float) -> str | None:
        """Return the reason against ``value`` (fitted, or too large for float32, or not finite), or None."""
        if not math.isfinite(value):
            return f"{self.name}: not a number"
        if not self._held(self.low) <= value <= self._held(self.high):
            allowed = f"{_SHOWN} to {_SHOWN}".format(self.low, self.high)
            return f"{self.name}: {_SHOWN.format(value)} is not in {allowed}"
        if self.kind in _BITS and not -(1 << _BITS[self.kind] - 1) <= value < 1 << _BITS[self.kind] - 1:
            return f"{self.name}: {_SHOWN.format(value)} does not fit"
        if self.bound and self.bound.options and value not in dict(self.bound.options):
            return f"{self.name}: {value:.0f} is not simulated"
        return None

    def _held(self, end: float) -> float:
        """Return an end of the range as the type stores it: 0.03 is slightly less in float32."""
        return self.fitted(end) if math.isfinite(end) else end


def encoded(value: float, kind: Kind, *, bytewise: bool) -> bytes:
    """Return the four bytes of PARAM_VALUE (22) and PARAM_SET (23) for ``value``, which must fit ``kind``.

    ArduPilot casts every number to float32. PX4 is ``bytewise``: it stores the bytes of an int32
    (MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE).
    """
    if bytewise and kind is not Kind.REAL32:
        return _INT.pack(int(value))
    return _FLOAT.pack(value)


def decoded(raw: bytes, kind: Kind, *, bytewise: bool) -> float:
    """Return the value of four bytes; it may be infinite or NaN."""
    layout = _INT if bytewise and kind is not Kind.REAL32 else _FLOAT
    return float(layout.unpack(raw)[0])
