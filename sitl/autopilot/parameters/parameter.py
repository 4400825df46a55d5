"""One parameter: its name, type, range, and what it does here."""

from __future__ import annotations

import math
from enum import Enum
from struct import Struct
from typing import Final, NamedTuple

_FLOAT: Final = Struct("<f")
# ``set`` says it to a person, so an absurd number must not fill the screen.
_SHOWN: Final = "{:.6g}"


class Kind(Enum):
    """MAV_PARAM_TYPE of what firmwares have."""

    INT8 = 2
    INT16 = 4
    INT32 = 6
    REAL32 = 9


_BITS: Final = {Kind.INT8: 8, Kind.INT16: 16, Kind.INT32: 32}


class Bound(NamedTuple):
    """The setting of ``AutopilotConfig`` that a parameter is: value × ``scale``, or one of ``options``.

    ``setting`` may be one of a group (``fence.height``); one that is None is as the firmware has it.
    """

    setting: str
    scale: float = 1.0
    options: tuple[tuple[int, str], ...] = ()


class Parameter(NamedTuple):
    """``default`` is the firmware's own; one that is ``bound`` begins as the setting is. ``low`` and ``high``
    are inclusive and in ``unit``, infinite where the firmware gives no range."""

    name: str
    kind: Kind
    default: float
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    bound: Bound | None = None

    def fitted(self, value: float) -> float:
        """``value`` as the type holds it: float32, or the nearest whole number."""
        return float(_FLOAT.unpack(_FLOAT.pack(value))[0]) if self.kind is Kind.REAL32 else round(value)

    def denial(self, value: float) -> str | None:
        """Why it cannot have ``value``, which is as ``fitted`` makes it or not finite."""
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
        """An end of the range as the type holds it: 0.03 is a little less in float32."""
        return self.fitted(end) if math.isfinite(end) else end
