"""Encoding of arrays as text in a page: multiples of a quantum as small integers in base64."""

from __future__ import annotations

import base64
from typing import NamedTuple

import numpy as np

from outrider.report.run import Array


class Packed(NamedTuple):
    """Encoded array.

    ``shape``; ``kind`` of the integers, i2 or i4, little-endian; ``quantum``: value of one unit; ``data``:
    base64. The smallest integer of the kind represents NaN.
    """

    shape: tuple[int, ...]
    kind: str
    quantum: float
    data: str


def pack(values: Array, quantum: float) -> Packed:
    """Round ``values`` to multiples of ``quantum`` and encode them.

    Values that are not finite, or do not fit into 32 bits, become NaN.
    """
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
    """Decode an array, as the page's own script does."""
    integers = np.frombuffer(base64.b64decode(packed.data), dtype=f"<{packed.kind}").reshape(packed.shape)
    values = integers * packed.quantum
    result: Array = np.where(integers == np.iinfo(integers.dtype).min, np.nan, values)
    return result
