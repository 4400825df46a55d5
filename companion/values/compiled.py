"""Compilation of the planner's arithmetic by numba: double precision, no fast-math, no reassociation.

A kernel is compiled for fixed argument types when its module is imported, and its machine code is kept on
disk, so nothing is compiled in flight. A part is inlined into the kernels of its module that call it. Numba
compiles a stored kernel again only if the kernel's own file has changed: so a kernel and its parts must be in
the same file.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core.caching import FunctionCache


def _load_array_functions() -> None:
    """Load numba's array functions without scipy.linalg.

    Numba imports it if it is installed, which takes a seventh of a companion's start and 17 MiB. Of the array
    functions only ``np.convolve`` and ``np.correlate`` use it, which no kernel calls.
    """
    name, modules = "scipy.linalg.cython_blas", cast("dict[str, object]", sys.modules)
    if name in modules:
        return
    modules[name] = None
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        del modules[name]


_load_array_functions()

_F = TypeVar("_F", bound=Callable[..., Any])

FLOAT, BOOL, INT, VOID = types.float64, types.boolean, types.int64, types.void
"""Types of scalars and results."""


def array(dimensions: int, of: Any = FLOAT) -> Any:
    """Return the type of an input array; it may be read-only, and a vector need not be contiguous."""
    return types.Array(of, dimensions, "A" if dimensions == 1 else "C", readonly=True)


def several(count: int, of: Any = FLOAT) -> Any:
    """Return the type of a tuple of ``count`` numbers."""
    return cast(Any, types.UniTuple)(of, count)


def output(dimensions: int, of: Any = FLOAT) -> Any:
    """Return the type of an array that a kernel writes; it is contiguous."""
    return types.Array(of, dimensions, "C")


def kernel(result: Any, *arguments: Any) -> Callable[[_F], _F]:
    """Compile a function for these types; a division by zero gives inf or NaN as in NumPy.

    An argument of another type is a TypeError. The machine code is stored if numba finds a directory for it.
    A read-only system without a home directory has none, and compiles at each start. Stored code that cannot
    be read, as after a loss of power, is replaced; where there is no room for it, it is not stored.
    """
    signature = result(*arguments)

    def compiled(function: _F) -> _F:
        def compile_(*, stored: bool) -> Any:
            return numba.njit(signature, error_model="numpy", cache=stored)(function)

        # A damaged file may raise any error while numba reads it.
        try:
            found = compile_(stored=True)
        except Exception:
            try:
                cast(Any, FunctionCache)(function).flush()
                found = compile_(stored=True)
            except Exception:
                found = compile_(stored=False)
        if found.stats.cache_hits:
            _free_intermediate_code(found)
        return cast(_F, found)

    return compiled


def _free_intermediate_code(loaded: Any) -> None:
    """Free LLVM's intermediate code of a loaded kernel, a tenth of a companion's memory at its start.

    Numba keeps it to compile it into other kernels. The kernels of a file are compiled together, and none
    calls a kernel of another file, so a loaded one is not needed for that.
    """
    for result in loaded.overloads.values():
        module = getattr(result.library, "_shared_module", None)
        if module is not None:
            module.close()
            result.library._shared_module = None


def part(function: _F) -> _F:
    """Compile a function as a part of the kernels that call it."""
    return cast(_F, numba.njit(error_model="numpy", forceinline=True)(function))
