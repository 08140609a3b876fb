"""Columns of some sensors among others."""

from __future__ import annotations

import numpy as np

from sagittal.core.frames import Segment
from sagittal.core.timeline.columns import find_columns, take_columns

THERE: tuple[Segment, ...] = ("pelvis", "foot_l", "foot_r")


def test_the_same_sensors_in_the_same_order_need_no_columns() -> None:
    assert find_columns(list(THERE), THERE) is None
    for expected, columns in (
        (("pelvis", "foot_l"), [0, 1]),
        (("foot_r", "pelvis"), [2, 0]),
        (("foot_r", "foot_l", "pelvis"), [2, 1, 0]),
        ((), []),
    ):
        result = find_columns(expected, THERE)  # type: ignore[arg-type]
        assert result is not None
        assert result.tolist() == columns


def test_some_columns_are_copied_in_order_and_all_are_handed_on() -> None:
    acc = np.arange(18.0).reshape(2, 3, 3)
    gyr, valid = -acc, np.array([[True, False, True], [False, False, True]])
    a, g, v = take_columns(acc, gyr, valid, np.array([2, 0]))
    assert np.array_equal(a, acc[:, [2, 0]])
    assert np.array_equal(g, gyr[:, [2, 0]])
    assert np.array_equal(v, valid[:, [2, 0]])
    assert all(x.flags.c_contiguous for x in (a, g, v))
    a, g, v = take_columns(acc, gyr, valid, None)
    assert a is acc
    assert g is gyr
    assert v is valid
