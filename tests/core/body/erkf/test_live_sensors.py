"""Sensors of a live trial: columns, bias removal, foot paths."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body.erkf.live_erkf import live_params
from sagittal.core.body.erkf.live_sensors import FilteredSensors, FootPaths
from sagittal.core.body.live_estimator import MeasuredBlock
from sagittal.core.frames import GRAVITY, Segment
from tests.core.body.live_standing import BODY, NEUTRAL, RATE, mounted, stand

WORN: tuple[Segment, ...] = ("chest", "foot_r", "foot_l")
FEET: tuple[Segment, ...] = ("foot_l", "foot_r")


def feet() -> FilteredSensors:
    column = {s: i for i, s in enumerate(WORN)}
    return FilteredSensors(FEET, column, mounted(*WORN), BODY, RATE, live_params())


def test_feet_that_stand_are_at_rest_level_and_below_the_hips() -> None:
    paths = FootPaths(feet())
    frames = [paths.push(stand(n, *WORN)) for n in (100, 30)]
    for block in frames:
        assert block.valid.all()
        assert block.q == pytest.approx(np.broadcast_to(NEUTRAL, block.q.shape), abs=1e-9)
    assert frames[1].still.all()
    left, right = frames[1].p[-1]
    assert left[1] - right[1] == pytest.approx(BODY.hip_width, abs=1e-6)
    assert left[2] == pytest.approx(right[2])
    assert not paths.broken


def test_bias_and_what_the_norm_is_over_gravity_are_taken_off() -> None:
    signals = feet().push(stand(100, *WORN)).signals
    assert signals.gyr == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(signals.acc, axis=2) == pytest.approx(GRAVITY)


def test_each_foot_reads_its_own_column() -> None:
    filtered = feet()
    filtered.push(stand(100, *WORN))
    moved = stand(50, *WORN)
    moved.gyr[:, 0] += 5.0
    moved.gyr[:, 1, 2] += 2.0
    moved.valid[40:, 2] = False
    block = filtered.push(moved)
    assert block.signals.gyr[:, 1, 2] == pytest.approx(2.0)
    assert block.signals.valid[:, 1].all()
    assert block.signals.valid[:, 0].tolist() == [True] * 40 + [False] * 10
    assert block.signals.still[-1].tolist() == [[False, False], [False, False]]
    assert block.signals.still[30].tolist() == [[True, True], [False, False]]
    turn = 2.0 * np.arccos(np.clip(np.abs((block.q[-1] * NEUTRAL).sum(axis=1)), 0.0, 1.0))
    assert turn == pytest.approx([0.0, 2.0 * 49 / RATE], abs=0.06)


def test_more_than_one_lost_packet_in_a_row_is_a_patch_from_the_second_on_while_the_foot_moves() -> None:
    parts = []
    for size in (60, 7):
        paths = FootPaths(feet())
        paths.push(stand(100, *WORN))
        moved = stand(60, *WORN)
        moved.gyr[:30, 2, 2] += 2.0
        moved.filled[[5, 10, 11, 20, 21, 22, 23, 50, 51, 52], 2] = True
        cuts = (slice(k, k + size) for k in range(0, 60, size))
        patcheds = [
            paths.push(MeasuredBlock(moved.acc[k], moved.gyr[k], moved.valid[k], {}, moved.filled[k])).patched
            for k in cuts
        ]
        parts.append(np.argwhere(np.concatenate(patcheds)).tolist())
    assert parts[0] == parts[1] == [[k, 0] for k in (11, 21, 22, 23)]


def test_a_lost_foot_has_no_path_and_a_mad_one_breaks_them() -> None:
    paths = FootPaths(feet())
    paths.push(stand(100, *WORN))
    lost = stand(60, *WORN)
    lost.valid[:, 2] = False
    assert paths.push(lost).valid.tolist() == [[False, True]] * 60
    mad = stand(20, *WORN)
    mad.acc[:] = 1e14
    paths.push(mad)
    # the next rest shows it
    final_frame = paths.push(stand(200, *WORN))
    assert paths.broken
    assert not final_frame.valid[-1].any()
    assert not paths.push(stand(5, *WORN)).valid.any()
