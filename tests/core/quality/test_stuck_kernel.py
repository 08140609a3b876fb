"""Parts of the stuck-channel rule: rest, full scale, loops."""

from __future__ import annotations

import numpy as np

from sagittal.core.frames import GRAVITY
from sagittal.core.quality.stuck import StuckWatch
from sagittal.core.quality.stuck_kernel import FROZEN, LOOPED, _ends_a_range, _follow_loops

ends_a_range, follow_loops = _ends_a_range.py_func, _follow_loops.py_func


def test_the_end_of_a_range_is_met_within_a_hundredth() -> None:
    full = np.array([16.0 * GRAVITY])
    assert ends_a_range(15.9 * GRAVITY, full)
    assert not ends_a_range(15.8 * GRAVITY, full)


def test_a_loop_is_told_by_its_shortest_packet() -> None:
    ring, loop = np.full((6, 6), np.nan), np.zeros(6, np.int64)
    notices = []
    for k in range(9):
        x = np.full(6, float(k % 2))
        notices.append(int(follow_loops(ring, loop, k % 6, 0, x, 4.0)))
    # from the third sample on each equals the one two before it
    assert notices == [-1, -1, -1, -1, -1, 4, 5, 6, 7]


def test_a_sensor_at_rest_may_repeat_its_sample_and_a_moving_one_may_not() -> None:
    watch = StuckWatch(1, 100.0)
    acc, gyr, valid = np.zeros((10, 1, 3)), np.zeros((10, 1, 3)), np.ones((10, 1), np.bool_)
    acc[..., 2] = GRAVITY
    assert watch.push(acc, gyr, valid) is None
    frame = watch.push(acc, gyr + 5.0, valid)
    assert frame is not None
    faults = set(frame[0].ravel().tolist())
    assert FROZEN in faults
    assert LOOPED not in faults
