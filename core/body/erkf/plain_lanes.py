"""Scalar variant of `lanes`, using only the documented interface of Numba."""

from __future__ import annotations

from typing import Final

import numba

STEP: Final = 1
"""Numbers in one of these lanes."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def read_lanes(array, row, column):  # type: ignore[no-untyped-def]
    """Read a number from an array (rows, columns)."""
    return array[row, column]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def write_lanes(array, row, column, lanes):  # type: ignore[no-untyped-def]
    """Inverse of `read_lanes`."""
    array[row, column] = lanes


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def spread(number):  # type: ignore[no-untyped-def]
    """The number itself."""
    return number


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def read_columns(array, row, column):  # type: ignore[no-untyped-def]
    """Eight numbers of a row from a position on."""
    return (
        array[row, column], array[row, column + 1], array[row, column + 2], array[row, column + 3],
        array[row, column + 4], array[row, column + 5], array[row, column + 6], array[row, column + 7],
    )  # fmt: skip


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def write_columns(array, row, column, columns):  # type: ignore[no-untyped-def]
    """Inverse of `read_columns`."""
    for k in range(8):
        array[row, column + k] = columns[k]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def mix(M, i, x, y, z):  # type: ignore[no-untyped-def]
    """Row i of a matrix (3, 3) times three numbers."""
    return M[i, 0] * x + M[i, 1] * y + M[i, 2] * z
