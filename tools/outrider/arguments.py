"""Checks of arguments from Python programs: each wrong one is one error that names it and what is allowed."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from outrider.errors import InputError

Array = NDArray[np.float64]


def checked(name: str, value: ArrayLike, shape: tuple[int | str, ...], unit: str) -> Array:
    """Return a read-only copy of ``value`` as float64 of ``shape``; a text in ``shape`` stands for any size.

    Raises InputError with ``name``, what was given, and the shape and ``unit`` that are allowed.
    """
    wanted = f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''}), {unit}"
    try:
        found = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: is no array of numbers; allowed: shape {wanted}") from None
    fits = found.ndim == len(shape) and all(
        isinstance(size, str) or size == given for size, given in zip(shape, found.shape, strict=True)
    )
    if not fits:
        raise InputError(f"{name}: has shape {found.shape}; allowed: {wanted}")
    if not np.isfinite(found).all():
        raise InputError(f"{name}: holds a value that is not finite; allowed: finite numbers, {unit}")
    found.flags.writeable = False
    return found


def number(
    name: str, value: float, unit: str, *, least: float | None = None, above: float | None = None
) -> float:
    """Return ``value`` if it is a finite number of at least ``least``, or above ``above``.

    Otherwise raise InputError.
    """
    bound = "" if least is None else f" of at least {least:g}"
    bound += "" if above is None else f" above {above:g}"
    allowed = f"allowed: a finite number{bound}, {unit}"
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
        raise InputError(f"{name}: is no number; {allowed}")
    found = float(value)
    below = (least is not None and found < least) or (above is not None and found <= above)
    if not isfinite(found) or below:
        raise InputError(f"{name}: is {found:g}; {allowed}")
    return found


def whole(name: str, value: int, *, least: int, most: int | None = None) -> int:
    """Return ``value`` if it is a whole number from ``least`` to ``most``; otherwise raise InputError."""
    wrong = isinstance(value, bool) or not isinstance(value, int | np.integer)
    if wrong or value < least or (most is not None and value > most):
        bounds = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise InputError(f"{name}: is {value!r}; allowed: a whole number {bounds}")
    return int(value)


def system_id(name: str, value: int) -> int:
    """Return ``value`` if it is a vehicle's id, 1 to 255; otherwise raise InputError."""
    return whole(name, value, least=1, most=255)
