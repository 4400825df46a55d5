"""Compilation of the planner's arithmetic by numba: double precision, no fast-math, no reassociation.

A kernel is compiled for fixed argument types when its module is imported, and its machine code is kept on
disk, so nothing is compiled in flight. A part is inlined into the kernels that call it. Numba compiles a
stored kernel again if the kernel's own file has changed; here it does so too if parts or constants have
changed that come from other files, which must be imported by their names. A kernel calls no other kernel.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterator
from types import CodeType
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
    be read, as after a loss of power, is replaced; where there is no room for it, it is not stored. Raises
    TypeError for a kernel that calls another one.
    """
    signature = result(*arguments)

    def compiled(function: _F) -> _F:
        used = _digest(function)

        def compile_(*, stored: bool) -> Any:
            found = cast(Any, numba.njit(error_model="numpy")(function))
            if stored:
                found.enable_caching()
                # Numba would put variables of a closure into the key, which a decorator cannot add. Without
                # this attribute of numba's own the kernel is not stored.
                store = found._cache._cache_file
                store._source_stamp = store._source_stamp, used
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


def _digest(kernel: Any) -> bytes:
    """Return a digest of the parts of a ``kernel`` from other files, and of all constants.

    It is that of the bytecode, because an installation may lack the sources.
    """
    digest, found, seen = hashlib.sha256(), [kernel], set[Any]()
    while found:
        function = found.pop()
        seen.add(function)
        elsewhere = function.__code__.co_filename != kernel.__code__.co_filename
        for code in _codes(function.__code__):
            if elsewhere:
                constants = [one for one in code.co_consts if not isinstance(one, CodeType)]
                digest.update(repr((code.co_code, code.co_names, code.co_varnames, constants)).encode())
            for name in code.co_names:
                used = function.__globals__.get(name)
                if isinstance(used, int | float | tuple):
                    digest.update(f"{name}={used!r};".encode())
                elif isinstance(used, Dispatcher):
                    if not used.targetoptions.get("forceinline"):
                        raise TypeError(f"{kernel.__name__} calls {name}, which is a kernel and no part")
                    found += [used.py_func] if used.py_func not in seen else []
    return digest.digest()


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield ``code`` and the code of functions and comprehensions within it."""
    yield code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _codes(inner)


def _free_intermediate_code(loaded: Any) -> None:
    """Free LLVM's intermediate code of a loaded kernel, a tenth of a companion's memory at its start.

    Numba keeps it to compile it into other kernels, which none is: a kernel calls parts only.
    """
    for result in loaded.overloads.values():
        module = getattr(result.library, "_shared_module", None)
        if module is not None:
            module.close()
            result.library._shared_module = None


def part(function: _F) -> _F:
    """Compile a function as a part of the kernels that call it."""
    return cast(_F, numba.njit(error_model="numpy", forceinline=True)(function))
