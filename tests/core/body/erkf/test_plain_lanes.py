"""One number at a time: the same parts, so that a loop over all gives what eight at a time give."""

from __future__ import annotations

import numba
import numpy as np

from sagittal.core.body.erkf import plain_lanes, vector_lanes
from sagittal.core.body.erkf.plain_lanes import (
    STEP,
    mix,
    read_columns,
    read_lanes,
    spread,
    write_columns,
    write_lanes,
)


@numba.njit  # type: ignore[misc, unused-ignore]
def mix_rows(rows, M, out):  # type: ignore[no-untyped-def]
    for c in range(0, rows.shape[1], STEP):
        x, y, z = read_lanes(rows, 0, c), read_lanes(rows, 1, c), read_lanes(rows, 2, c)
        for i in range(3):
            write_lanes(out, i, c, mix(M, i, x, y, z) - spread(2.0) * x)


@numba.njit  # type: ignore[misc, unused-ignore]
def turn_columns(source, target):  # type: ignore[no-untyped-def]
    for r in range(0, len(source), STEP):
        a0, a1, a2, a3, a4, a5, a6, a7 = read_columns(source, r, 2)
        write_columns(target, r, 1, (a7, a0, a1, a2, a3, a4, a5, a6))


def test_sums_and_products_go_number_by_number() -> None:
    rng = np.random.default_rng(1)
    rows, M, out = rng.normal(size=(3, 8)), rng.normal(size=(3, 3)), np.empty((3, 8))
    mix_rows(rows, M, out)
    x, y, z = rows
    for i in range(3):
        np.testing.assert_array_equal(out[i], M[i, 0] * x + M[i, 1] * y + M[i, 2] * z - 2.0 * x)


def test_columns_are_read_and_written_where_they_are() -> None:
    source, target = np.random.default_rng(2).normal(size=(8, 10)), np.zeros((8, 10))
    turn_columns(source, target)
    np.testing.assert_array_equal(target[:, 1:9], np.roll(source[:, 2:], 1, axis=1))
    assert not target[:, 0].any()
    assert not target[:, 9].any()


def test_every_part_of_the_lanes_has_its_twin() -> None:
    named = {"STEP", "mix", "read_columns", "read_lanes", "spread", "write_columns", "write_lanes"}
    assert named <= vars(plain_lanes).keys() & vars(vector_lanes).keys()
