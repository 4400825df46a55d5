"""Compilation of the planner's arithmetic by numba: double precision, no fast-math, no reassociation.

A kernel is compiled for fixed argument types when its module is imported, and its machine code is kept on
disk, so nothing is compiled in flight. A part is inlined into the kernels that call it. Numba compiles a
stored kernel again only if the kernel's own file has changed; here it does so too if another file has changed
from which a kernel, or a part of it, imports parts by their names. A constant has to be in the file of the
kernel or part that uses it.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher


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
            found = cast(Any, numba.njit(error_model="numpy")(function))
            if stored:
                found.enable_caching()
                _watch_other_files(found)
            found.compile(signature)
            found.disable_compile()
            return found

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


def _watch_other_files(kernel: Any) -> None:
    """Add a digest of the other files that parts of a kernel come from to the stamp of its stored code.

    Numba offers no other way to compile it again after a change of these.
    """
    files, found, seen = set[str](), [kernel.py_func], set[Any]()
    while found:
        function = found.pop()
        seen.add(function)
        files.add(function.__code__.co_filename)
        used = (function.__globals__.get(name) for name in function.__code__.co_names)
        found += [one.py_func for one in used if isinstance(one, Dispatcher) and one.py_func not in seen]
    files.remove(kernel.py_func.__code__.co_filename)
    if not files:
        return
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(Path(file).read_bytes())
    store = kernel._cache._cache_file
    store._source_stamp = store._source_stamp, digest.digest()


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
