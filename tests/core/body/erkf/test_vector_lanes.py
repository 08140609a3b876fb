"""Eight numbers at a time give the bits of one at a time."""

from __future__ import annotations

import numba
import numpy as np

from sagittal.core.body.erkf.vector_lanes import mix, read_columns, read_lanes, write_columns, write_lanes


@numba.njit  # type: ignore[misc, unused-ignore]
def mix_rows(rows, M, out):  # type: ignore[no-untyped-def]
    x, y, z = read_lanes(rows, 0, 1), read_lanes(rows, 1, 1), read_lanes(rows, 2, 1)
    for i in range(3):
        write_lanes(out, i, 0, mix(M, i, x, y, z) - x * y)


@numba.njit  # type: ignore[misc, unused-ignore]
def move_columns(source, target):  # type: ignore[no-untyped-def]
    a0, a1, a2, a3, a4, a5, a6, a7 = read_columns(source, 1, 2)
    write_columns(target, 0, 1, (a7, a0, a1, a2, a3, a4, a5, a6))


def test_sums_and_products_are_those_of_single_numbers() -> None:
    rng = np.random.default_rng(1)
    rows, M, out = rng.normal(size=(3, 9)), rng.normal(size=(3, 3)), np.empty((3, 8))
    mix_rows(rows, M, out)
    x, y, z = rows[:, 1:]
    for i in range(3):
        expected = M[i, 0] * x + M[i, 1] * y + M[i, 2] * z - x * y
        np.testing.assert_array_equal(out[i], expected)


def test_columns_are_read_and_written_where_they_are() -> None:
    source, target = np.random.default_rng(2).normal(size=(9, 10)), np.zeros((8, 10))
    move_columns(source, target)
    np.testing.assert_array_equal(target[:, 1:9], np.roll(source[1:, 2:], 1, axis=1))
    assert not target[:, 0].any()
    assert not target[:, 9].any()
