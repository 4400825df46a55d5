"""Compilation of ``sitl``'s arithmetic: double precision, no fast-math, no reassociation.

A *kernel* is inlined into its caller, for one vehicle or for a block of vehicles (``simd``). Numba's cache on
disk monitors only the file of the stored function, so an *entry* carries a digest of every source that its
kernels come from: an edit of one of them forces a new compilation.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

import sitl.vehicle.simd_compiled  # noqa: F401  (registers the lanes with numba)

FLIGHT_SOURCES = (
    "simd.py",
    "simd_compiled.py",
    "vectors.py",
    "derivatives.py",
    "angles.py",
    "body.py",
    "rotors.py",
    "allocation.py",
    "controller.py",
    "observer.py",
    "pipeline.py",
)
"""Files from which the kernels of a flight come, whichever integrator moves the body."""

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F) -> _F:
    """Compile ``function`` at its first call; a division by zero gives inf or NaN as in NumPy."""
    return cast(_F, numba.njit(error_model="numpy", forceinline=True)(function))


def entry(function: _F) -> _F:
    """Compile ``function`` at its first call; keep the machine code on disk if numba finds a directory."""
    try:
        return cast(_F, numba.njit(error_model="numpy", cache=True)(function))
    except RuntimeError:  # numba found no directory for its cache, as in a read-only image without a home
        return cast(_F, numba.njit(error_model="numpy")(function))


def sources_digest(*names: str) -> int:
    """Return a digest of the text of these files (paths from this folder), for an ``entry``'s closure."""
    digest = hashlib.sha256()
    for name in names:
        digest.update((Path(__file__).parent / name).read_bytes())
    return int.from_bytes(digest.digest()[:7], "big")
