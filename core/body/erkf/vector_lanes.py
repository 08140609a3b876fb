"""Vector variant of `lanes` with eight numbers, built directly for LLVM, which maps them to the processor's
registers.

It compiles in half the time of the equivalent Python code, but uses undocumented names of Numba and llvmlite:
it is imported only by `lanes`, and only with tested versions.
"""

from __future__ import annotations

import operator
from typing import Any, Final

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, overload, register_model

STEP: Final = 8
"""Numbers in one `Lanes`: a line of the processor's cache."""

_VECTOR: Final = ir.VectorType(ir.DoubleType(), STEP)


class LanesType(types.Type):  # type: ignore[misc, unused-ignore]
    """Eight float64 with elementwise addition, subtraction and multiplication; a scalar factor is
    broadcast.
    """

    def __init__(self) -> None:
        super().__init__(name="lanes")


LANES: Final = LanesType()

_EIGHT: Final[Any] = types.UniTuple(LANES, STEP)  # type: ignore[attr-defined, unused-ignore]


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc, unused-ignore]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


def _find(context: Any, builder: Any, kind: Any, args: Any) -> Any:
    """Address of a row and column of an array, as used by `read_lanes`."""
    array = context.make_array(kind)(context, builder, args[0])
    place = cgutils.get_item_pointer(context, builder, kind, array, args[1:3], wraparound=False)
    return builder.bitcast(place, _VECTOR.as_pointer())


@intrinsic
def read_lanes(_: Any, array: Any, row: Any, column: Any) -> Any:
    """Eight numbers of an array (rows, columns) from a position on; the caller must ensure that they
    exist.
    """

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(_find(context, builder, signature.args[0], args), align=8)

    return LANES(array, types.intp, types.intp), make


@intrinsic
def write_lanes(_: Any, array: Any, row: Any, column: Any, lanes: Any) -> Any:
    """Inverse of `read_lanes`."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[3], _find(context, builder, signature.args[0], args), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, LANES), make


@intrinsic
def spread(_: Any, number: Any) -> Any:
    """Broadcast a number to eight lanes."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _spread(builder, args[0])

    return LANES(types.float64), make


def _spread(builder: Any, number: Any) -> Any:
    none, index = ir.Constant(_VECTOR, ir.Undefined), ir.IntType(32)
    one = builder.insert_element(none, number, index(0))
    return builder.shuffle_vector(one, none, ir.Constant(ir.VectorType(index, STEP), [0] * STEP))


@intrinsic
def read_columns(_: Any, array: Any, row: Any, column: Any) -> Any:
    """Eight columns from a position on as `Lanes` of eight rows, of an array (rows, columns)."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        rows = [builder.load(place, align=8) for place in _find_rows(context, builder, signature, args)]
        return context.make_tuple(builder, signature.return_type, _transpose(builder, rows))

    return _EIGHT(array, types.intp, types.intp), make


@intrinsic
def write_columns(_: Any, array: Any, row: Any, column: Any, columns: Any) -> Any:
    """Inverse of `read_columns`."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        rows = _transpose(builder, cgutils.unpack_tuple(builder, args[3], STEP))
        for vector, place in zip(rows, _find_rows(context, builder, signature, args), strict=True):
            builder.store(vector, place, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, _EIGHT), make


def _find_rows(context: Any, builder: Any, signature: Any, args: Any) -> list[Any]:
    """Addresses, as from `_find`, of a row and the next seven rows."""
    steps = (ir.Constant(args[1].type, k) for k in range(STEP))
    rows = [builder.add(args[1], step) for step in steps]
    return [_find(context, builder, signature.args[0], (args[0], row, args[2])) for row in rows]


def _transpose(builder: Any, rows: Any) -> list[Any]:
    """Transpose eight `Lanes`: rows of a matrix → its columns."""
    vectors = list(rows)
    mask = ir.VectorType(ir.IntType(32), STEP)
    for s in (1, 2, 4):
        low = ir.Constant(mask, [STEP + (k ^ s) if k & s else k for k in range(STEP)])
        high = ir.Constant(mask, [STEP + k if k & s else k ^ s for k in range(STEP)])
        for i in range(STEP):
            if not i & s:
                a, b = vectors[i], vectors[i | s]
                vectors[i] = builder.shuffle_vector(a, b, low)
                vectors[i | s] = builder.shuffle_vector(a, b, high)
    return vectors


@intrinsic
def mix(_: Any, M: Any, i: Any, x: Any, y: Any, z: Any) -> Any:
    """Row i of a matrix (3, 3) times three `Lanes`: M[i, 0] × x + M[i, 1] × y + M[i, 2] × z."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = signature.args[0]
        array = context.make_array(kind)(context, builder, args[0])
        parts = []
        for k, lanes in enumerate(args[2:]):
            indices = (args[1], ir.Constant(args[1].type, k))
            place = cgutils.get_item_pointer(context, builder, kind, array, indices, wraparound=False)
            parts.append(builder.fmul(_spread(builder, builder.load(place)), lanes))
        return builder.fadd(builder.fadd(parts[0], parts[1]), parts[2])

    return LANES(M, types.intp, LANES, LANES, LANES), make


def _operation(name: str) -> Any:
    """An intrinsic for two `Lanes`, by the name of LLVM's operation."""

    @intrinsic
    def operate(_: Any, a: Any, b: Any) -> Any:
        def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return getattr(builder, name)(*args)

        return LANES(LANES, LANES), make

    return operate


_add, _subtract, _multiply = (_operation(name) for name in ("fadd", "fsub", "fmul"))


@overload(operator.add)
def _overload_add(a, b):  # type: ignore[no-untyped-def]
    return (lambda a, b: _add(a, b)) if a == b == LANES else None


@overload(operator.sub)
def _overload_sub(a, b):  # type: ignore[no-untyped-def]
    return (lambda a, b: _subtract(a, b)) if a == b == LANES else None


@overload(operator.mul)
def _overload_mul(a, b):  # type: ignore[no-untyped-def]
    if b != LANES:
        return None
    return (lambda a, b: _multiply(a, b)) if a == LANES else (lambda a, b: _multiply(spread(a), b))
