"""Rows out of order."""

from __future__ import annotations

import numpy as np

from sagittal.core.formats.clocks.order import sort_runs


def runs(stamps: list[float]) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    x = np.array(stamps)
    return x, np.ones(len(x), np.int64), 1.0, x.copy()


def test_swapped_packets_are_sorted_though_one_lies_in_the_hole_of_another() -> None:
    found = sort_runs(*runs([0, 1, 5, 6, 2, 3, 4, 10, 11, 7, 8, 9, 12, 13]))
    assert found.moved.tolist() == [2, 3, 7, 8]
    assert not found.wrong.any()
    assert found.order.tolist() == [0, 1, 4, 5, 6, 2, 3, 9, 10, 11, 7, 8, 12, 13]


def test_a_wrong_stamp_keeps_its_place_and_a_copy_goes() -> None:
    x, widths, step, same = runs([0, 1, 2, 40, 4, 5, 6, 7, 5, 8])
    found = sort_runs(x, widths, step, same)
    assert found.order[found.wrong].tolist() == [3]
    assert found.repeated.tolist() == [8]
