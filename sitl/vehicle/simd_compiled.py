"""Compilation of ``simd`` by numba: types for eight doubles and for eight conditions, and their operations.

Every arithmetic operation is lowered to one instruction of LLVM on the whole vector, every column to one load
or store. Importing this module registers the types and operations with numba; its names are private.
"""
# numba has no types, and passes more arguments than a lowering needs:
# mypy: allow-untyped-calls, allow-untyped-decorators, allow-subclassing-any
# ruff: noqa: ARG001

from __future__ import annotations

import math
import operator
from typing import Any, Final

from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import types
from numba.core.cgutils import get_or_insert_function, unpack_tuple
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, lower_cast, models, register_model
from numba.np.arrayobj import make_array

from sitl.vehicle.simd import LANES, at, nearest, put, put_three, some, three_at, where

_VECTOR: Final = ir.VectorType(ir.DoubleType(), LANES)
_BITS: Final = ir.VectorType(ir.IntType(1), LANES)


class _Lanes(types.Type):
    """Eight doubles. A float is broadcast."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")

    def can_convert_from(self, context: Any, other: Any) -> Any:
        """Return a safe conversion from float64, or None."""
        return Conversion.safe if other == types.float64 else None

    def unify(self, context: Any, other: Any) -> Any:
        """Return this type for a pair with float64, or None."""
        return self if other == types.float64 else None


class _Mask(types.Type):
    """Eight conditions. A single one is broadcast."""

    def __init__(self) -> None:
        super().__init__(name="Mask")

    def can_convert_from(self, context: Any, other: Any) -> Any:
        """Return a safe conversion from boolean, or None."""
        return Conversion.safe if other == types.boolean else None

    def unify(self, context: Any, other: Any) -> Any:
        """Return this type for a pair with boolean, or None."""
        return self if other == types.boolean else None


_lanes, _mask = _Lanes(), _Mask()


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


@register_model(_Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


@lower_cast(types.float64, _Lanes)
@lower_cast(types.boolean, _Mask)
def _broadcast(context: Any, builder: Any, given: Any, wanted: Any, value: Any) -> Any:
    empty = ir.Constant(context.get_value_type(wanted), ir.Undefined)
    first = ir.VectorType(ir.IntType(32), LANES)([0] * LANES)
    return builder.shuffle_vector(builder.insert_element(empty, value, ir.IntType(32)(0)), empty, first)


def _typed(function: Any, result: Any, arguments: int) -> None:
    """Declare that ``function`` of some lanes gives ``result``; floats among its arguments are broadcast."""

    class Rule(AbstractTemplate):
        def generic(self, given: Any, keywords: Any) -> Any:
            if keywords or len(given) != arguments or _lanes not in given:
                return None
            if not all(kind in (_lanes, types.float64) for kind in given):
                return None
            return signature(result, *[_lanes] * arguments)

    infer_global(function)(Rule)


def _exactly(function: Any, result: Any, *arguments: Any) -> None:
    """Declare that ``function`` of exactly these types gives ``result``."""

    class Rule(AbstractTemplate):
        def generic(self, given: Any, keywords: Any) -> Any:
            return None if keywords or given != arguments else signature(result, *arguments)

    infer_global(function)(Rule)


def _instruction(name: str, *before: str) -> Any:
    """Return a lowering to the builder's instruction ``name``; the arguments are ``before`` and values."""

    def lower(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return getattr(builder, name)(*before, *values)

    return lower


def _intrinsic(name: str) -> Any:
    """Return a lowering to the LLVM intrinsic ``name``, whose result has the type of its argument."""

    def lower(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        kind = values[0].type
        suffix = f"v{LANES}f64" if kind == _VECTOR else "f64"
        function = ir.FunctionType(kind, [kind])
        return builder.call(get_or_insert_function(builder.module, function, f"{name}.{suffix}"), values)

    return lower


for _operator, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _typed(_operator, _lanes, 2)
    lower_builtin(_operator, _lanes, _lanes)(_instruction(_name))

for _operator, _sign in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _typed(_operator, _mask, 2)
    lower_builtin(_operator, _lanes, _lanes)(_instruction("fcmp_ordered", _sign))

for _operator, _name in ((operator.and_, "and_"), (operator.or_, "or_")):
    _exactly(_operator, _mask, _mask, _mask)
    lower_builtin(_operator, _mask, _mask)(_instruction(_name))

_typed(operator.neg, _lanes, 1)
lower_builtin(operator.neg, _lanes)(_instruction("fneg"))

_typed(math.sqrt, _lanes, 1)
lower_builtin(math.sqrt, _lanes)(_intrinsic("llvm.sqrt"))
_typed(abs, _lanes, 1)
lower_builtin(abs, _lanes)(_intrinsic("llvm.fabs"))
_typed(nearest, _lanes, 1)
_exactly(nearest, types.float64, types.float64)
lower_builtin(nearest, _lanes)(_intrinsic("llvm.rint"))
lower_builtin(nearest, types.float64)(_intrinsic("llvm.rint"))


@infer_global(where)
class _Where(AbstractTemplate):
    def generic(self, given: Any, keywords: Any) -> Any:
        if keywords or len(given) != 3:
            return None
        kind = _lanes if given[0] == _mask else types.float64
        return signature(kind, given[0], kind, kind)


lower_builtin(where, _mask, _lanes, _lanes)(_instruction("select"))
lower_builtin(where, types.boolean, types.float64, types.float64)(_instruction("select"))

_exactly(some, types.boolean, types.boolean)
_exactly(some, types.boolean, _mask)


@lower_builtin(some, types.boolean)
def _itself(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    return values[0]


@lower_builtin(some, _mask)
def _some(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    bits = builder.bitcast(values[0], ir.IntType(LANES))
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


def _column(kind: Any) -> Any:
    """Return the type of one column of a row or a block, or None for other types."""
    if not isinstance(kind, types.Array) or kind.dtype != types.float64 or kind.layout != "C":
        return None
    return {1: types.float64, 2: _lanes}.get(kind.ndim)


def _reading(function: Any, count: int) -> None:
    """Declare that ``function`` of a row or block and a column gives ``count`` columns."""

    class Rule(AbstractTemplate):
        def generic(self, given: Any, keywords: Any) -> Any:
            value = None if keywords or len(given) != 2 else _column(given[0])
            if value is None:
                return None
            return signature(value if count == 1 else types.UniTuple(value, count), given[0], types.intp)

    def load(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        row, column = values
        places = _places(context, builder, sig.args[0], row, column, count)
        loaded = [builder.load(place, align=8) for place in places]
        return loaded[0] if count == 1 else context.make_tuple(builder, sig.return_type, loaded)

    infer_global(function)(Rule)
    lower_builtin(function, types.Array, types.intp)(load)


def _writing(function: Any, count: int) -> None:
    """Declare that ``function`` of a row or block, a column and a value sets ``count`` columns."""

    class Rule(AbstractTemplate):
        def generic(self, given: Any, keywords: Any) -> Any:
            value = None if keywords or len(given) != 3 else _column(given[0])
            if value is None:
                return None
            value = value if count == 1 else types.UniTuple(value, count)
            return signature(types.none, given[0], types.intp, value)

    def store(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        row, column, given = values
        parts = [given] if count == 1 else unpack_tuple(builder, given)
        places = _places(context, builder, sig.args[0], row, column, count)
        for place, part in zip(places, parts, strict=True):
            builder.store(part, place, align=8)
        return context.get_dummy_value()

    infer_global(function)(Rule)
    lower_builtin(function, types.Array, types.intp, types.Any)(store)


def _places(context: Any, builder: Any, kind: Any, array: Any, column: Any, count: int) -> list[Any]:
    """Return the addresses of ``count`` columns."""
    data = make_array(kind)(context, builder, array).data
    width = 1 if kind.ndim == 1 else LANES
    first = builder.mul(column, ir.Constant(column.type, width))
    places = [builder.gep(data, [builder.add(first, first.type(width * i))]) for i in range(count)]
    if kind.ndim == 1:
        return places
    return [builder.bitcast(place, ir.PointerType(_VECTOR)) for place in places]


_reading(at, 1)
_reading(three_at, 3)
_writing(put, 1)
_writing(put_three, 3)
