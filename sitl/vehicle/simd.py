"""Lanes: a number of a kernel is one double, or eight doubles for eight vehicles side by side.

A kernel is compiled for ``float`` and, for a block of vehicles, for *lanes*: a vector of eight doubles that
the machine's wide registers process at once. Both come from the same source, every operation on a lane is the
IEEE operation on a double, and nothing is reordered or fused, so a vehicle moves in a block exactly as alone,
to the bit. For lanes a condition is eight conditions, hence a kernel selects with ``where`` instead of
branching; rare work may stand behind ``if some(...)``, provided that ``where`` leaves the other lanes
unchanged.

The annotations of the kernels say ``float`` for both. Constants are written as floats. A *row* (C,) holds the
numbers of one vehicle, a *block* (C, LANES) those of eight; both are C-contiguous, and no index is checked.
The bodies here define the meaning of the functions; ``simd_compiled`` defines their compilation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from sitl.vehicle.airframe import FloatArray

LANES: Final = 8
"""Number of vehicles in a block: eight doubles fill one register of AVX-512, two of AVX2, four of NEON."""


def where(condition: bool, a: float, b: float) -> float:
    """Return ``a`` in the lanes where the condition holds, else ``b``; both are evaluated."""
    return a if condition else b


def some(condition: bool) -> bool:
    """Return whether the condition holds in any lane."""
    return condition


def nearest(x: float) -> float:
    """Return the integer nearest to ``x`` as a float; halfway, the even one."""
    return float(round(x))


def at(row: FloatArray, column: int) -> float:
    """Return a column of a row, or the lanes of a block's column."""
    value: float = row[column]
    return value


def put(row: FloatArray, column: int, value: float) -> None:
    """Set a column of a row, or the lanes of a block's column."""
    row[column] = value


def three_at(row: FloatArray, column: int) -> tuple[float, float, float]:
    """Return three columns from ``column`` on."""
    return (row[column], row[column + 1], row[column + 2])


def put_three(row: FloatArray, column: int, value: tuple[float, float, float]) -> None:
    """Set three columns from ``column`` on."""
    row[column], row[column + 1], row[column + 2] = value
