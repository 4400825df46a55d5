"""How ``sitl`` compiles its arithmetic: double precision, no fast-math, no reassociation.

A *kernel* is inlined by the function that calls it, for one vehicle or for a block of them (``lanes``).
Numba's cache on disk watches only the file of the function that it stores, so an *entry* carries a digest of
every source that its kernels come from: edit one and it is compiled anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

import sitl.vehicle.simd_compiled  # noqa: F401  (tells numba of the lanes)

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F) -> _F:
    """Compile ``function`` at its first call; a division by zero gives inf or NaN as in NumPy."""
    return cast(_F, numba.njit(error_model="numpy", forceinline=True)(function))


def entry(function: _F) -> _F:
    """Compile ``function`` at its first call and keep the machine code on disk, where there is room."""
    try:
        return cast(_F, numba.njit(error_model="numpy", cache=True)(function))
    except RuntimeError:  # numba found no directory for its cache: a read-only image without a home
        return cast(_F, numba.njit(error_model="numpy")(function))


def sources_digest(*names: str) -> int:
    """A number that changes with the text of these files of the package, for an ``entry``'s closure."""
    digest = hashlib.sha256()
    for name in names:
        digest.update((Path(__file__).parent / name).read_bytes())
    return int.from_bytes(digest.digest()[:7], "big")
