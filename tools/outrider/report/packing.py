"""Arrays as text in a page: whole multiples of a quantum, as small integers in base64."""

from __future__ import annotations

import base64
from typing import NamedTuple

import numpy as np

from outrider.report.run import Array


class Packed(NamedTuple):
    """``shape``; ``kind`` of its integers, i2 or i4, little endian; ``quantum``: what one of them is worth;
    ``data``, base64. The least integer of its kind stands for NaN."""

    shape: tuple[int, ...]
    kind: str
    quantum: float
    data: str


def pack(values: Array, quantum: float) -> Packed:
    """``values`` to the nearest whole multiple of ``quantum``; what is not finite, or does not fit 32 bits,
    becomes NaN."""
    with np.errstate(invalid="ignore"):
        whole = np.round(np.asarray(values, dtype=np.float64) / quantum)
        whole = np.where(np.abs(whole) < np.iinfo(np.int32).max, whole, np.nan)
    most = float(np.abs(np.nan_to_num(whole)).max(initial=0.0))
    kind = np.dtype("<i2" if most <= np.iinfo(np.int16).max else "<i4")
    nothing = np.iinfo(kind).min
    integers = np.where(np.isnan(whole), nothing, np.nan_to_num(whole)).astype(kind)
    data = base64.b64encode(integers.tobytes()).decode("ascii")
    return Packed(integers.shape, kind.str[1:], quantum, data)


def unpack(packed: Packed) -> Array:
    """What the page's own program makes of it."""
    integers = np.frombuffer(base64.b64decode(packed.data), dtype=f"<{packed.kind}").reshape(packed.shape)
    values = integers * packed.quantum
    result: Array = np.where(integers == np.iinfo(integers.dtype).min, np.nan, values)
    return result
