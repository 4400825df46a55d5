"""Reader of ``.npz`` files with checks: an error names the damaged array or the cause."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from outrider.errors import Fault, InputError

MOST_BYTES = 1 << 30
"""Largest total size (bytes) of a file's arrays, uncompressed.

An hour of a hundred vehicles at 50 Hz takes about three quarters of it.
"""
_ALLOWED = "allowed: a file written by this version of outrider"

_READ_ERRORS = (
    OSError,
    ValueError,
    TypeError,
    KeyError,
    EOFError,
    MemoryError,
    OverflowError,
    RuntimeError,  # from zipfile: encrypted, or compressed with an unknown method
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions that reading a damaged archive of arrays may raise."""

Shapes = Mapping[str, Sequence[int | str]]
"""Required shape by name of array. A number is a fixed size; equal letters have equal sizes everywhere."""
Arrays = dict[str, NDArray[np.generic]]


def read_arrays(path: Path, shapes: Shapes) -> Arrays:
    """Read the arrays that ``shapes`` names.

    Raises InputError for a file that cannot be read, and for an array that is missing, has another shape or
    holds neither signed integers nor floats.
    """
    found: Arrays = {}
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MOST_BYTES:
            raise _fault(path, f"unpacks to {size} bytes; allowed: at most {MOST_BYTES}")
        with np.load(path, allow_pickle=False) as file:
            for name in shapes:
                if name in file:
                    found[name] = file[name]
    except _READ_ERRORS as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise _fault(path, f"cannot be read: {reason or type(error).__name__}; {_ALLOWED}") from None
    sizes: dict[str, int] = {}
    for name, shape in shapes.items():
        if name not in found:
            raise _fault(path, f"holds no {name}; {_ALLOWED}")
        if found[name].dtype.kind not in "if":
            raise _fault(path, f"{name} holds neither signed integers nor floats; {_ALLOWED}")
        has = found[name].shape
        fits = len(has) == len(shape) and all(
            size == (sizes.setdefault(axis, size) if isinstance(axis, str) else axis)
            for size, axis in zip(has, shape, strict=True)
        )
        if not fits:
            wanted = ", ".join(str(sizes.get(str(axis), axis)) for axis in shape)
            raise _fault(path, f"{name} is of shape {has}; needed: ({wanted})")
    return found


def _fault(path: Path, what: str) -> InputError:
    return InputError(Fault(str(path), what))
