"""Eight numbers of a row at a time in compiled loops.

LLVM does so on its own where it can prove that what is written is not what is read. Of rows of one covariance
it can not: it asks before every loop, and loops here are a dozen lines of the cache long. Same operations in
the same order, so the same bits. LLVM splits eight into what a processor has.
"""

from __future__ import annotations

import operator
from typing import Any, Final

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, overload, register_model

IN_LINE: Final = 8
"""Numbers in one line of the processor's cache, and in one `Lanes`."""

_VECTOR: Final = ir.VectorType(ir.DoubleType(), IN_LINE)


class LanesType(types.Type):  # type: ignore[misc, unused-ignore]
    """Eight float64, which add, subtract and multiply by place; a number before × is multiplied by each."""

    def __init__(self) -> None:
        super().__init__(name="lanes")


LANES: Final = LanesType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc, unused-ignore]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


def _find(context: Any, builder: Any, kind: Any, args: Any) -> Any:
    """Address of the line that begins at a row and column of an array, as `read_lanes` takes them."""
    array = context.make_array(kind)(context, builder, args[0])
    place = cgutils.get_item_pointer(context, builder, kind, array, args[1:3], wraparound=False)
    return builder.bitcast(place, _VECTOR.as_pointer())


@intrinsic
def read_lanes(_: Any, array: Any, row: Any, column: Any) -> Any:
    """Eight numbers of an array (rows, columns) from a place on; the reader sees to it that there are so
    many."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(_find(context, builder, signature.args[0], args), align=8)

    return LANES(array, types.intp, types.intp), make


@intrinsic
def write_lanes(_: Any, array: Any, row: Any, column: Any, lanes: Any) -> Any:
    """The way back of `read_lanes`."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[3], _find(context, builder, signature.args[0], args), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, LANES), make


@intrinsic
def spread(_: Any, number: Any) -> Any:
    """A number eight times."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        none, index = ir.Constant(_VECTOR, ir.Undefined), ir.IntType(32)
        one = builder.insert_element(none, args[0], index(0))
        return builder.shuffle_vector(one, none, ir.Constant(ir.VectorType(index, IN_LINE), [0] * IN_LINE))

    return LANES(types.float64), make


@intrinsic
def transpose_lanes(_: Any, rows: Any) -> Any:
    """Eight `Lanes` as the rows of a matrix → its columns."""

    def make(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        found = list(cgutils.unpack_tuple(builder, args[0], IN_LINE))
        mask = ir.VectorType(ir.IntType(32), IN_LINE)
        for s in (1, 2, 4):
            low = ir.Constant(mask, [IN_LINE + (k ^ s) if k & s else k for k in range(IN_LINE)])
            high = ir.Constant(mask, [IN_LINE + k if k & s else k ^ s for k in range(IN_LINE)])
            for i in range(IN_LINE):
                if not i & s:
                    a, b = found[i], found[i | s]
                    found[i] = builder.shuffle_vector(a, b, low)
                    found[i | s] = builder.shuffle_vector(a, b, high)
        return context.make_tuple(builder, signature.return_type, found)

    kind: Any = types.UniTuple(LANES, IN_LINE)  # type: ignore[attr-defined, unused-ignore]
    return kind(kind), make


def _operation(name: str) -> Any:
    """An intrinsic of two `Lanes`, by the name of LLVM's operation."""

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


@numba.njit(cache=True, nogil=True, _nrt=False, inline="always")  # type: ignore[misc, unused-ignore]
def read_columns(P, r, c):  # type: ignore[no-untyped-def]
    """Eight columns from c on as `Lanes` of eight rows from r on."""
    return transpose_lanes((
        read_lanes(P, r, c), read_lanes(P, r + 1, c), read_lanes(P, r + 2, c), read_lanes(P, r + 3, c),
        read_lanes(P, r + 4, c), read_lanes(P, r + 5, c), read_lanes(P, r + 6, c), read_lanes(P, r + 7, c),
    ))  # fmt: skip


@numba.njit(cache=True, nogil=True, _nrt=False, inline="always")  # type: ignore[misc, unused-ignore]
def write_columns(P, r, c, columns):  # type: ignore[no-untyped-def]
    """The way back of `read_columns`."""
    a0, a1, a2, a3, a4, a5, a6, a7 = transpose_lanes(columns)
    write_lanes(P, r, c, a0)
    write_lanes(P, r + 1, c, a1)
    write_lanes(P, r + 2, c, a2)
    write_lanes(P, r + 3, c, a3)
    write_lanes(P, r + 4, c, a4)
    write_lanes(P, r + 5, c, a5)
    write_lanes(P, r + 6, c, a6)
    write_lanes(P, r + 7, c, a7)


@numba.njit(cache=True, nogil=True, _nrt=False, inline="always")  # type: ignore[misc, unused-ignore]
def mix(M, i, x, y, z):  # type: ignore[no-untyped-def]
    """Row i of a matrix (3, 3) times three `Lanes`."""
    return M[i, 0] * x + M[i, 1] * y + M[i, 2] * z
