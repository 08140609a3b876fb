"""Live samples of a failed sensor: marked, reported once, excluded."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import Notice
from sagittal.core.frames import GRAVITY, Bools, Floats, Segment
from sagittal.core.quality.live_stuck import StuckSensors
from sagittal.core.timeline.live import UniformBlock

RATE, FROZEN_AT = 100.0, 425


def signals(n: int = 700) -> tuple[Floats, Floats]:
    """Two sensors that move; the second repeats one sample from `FROZEN_AT` on, for two seconds."""
    rng = np.random.default_rng(3)
    swing = np.sin(2.0 * np.pi * np.arange(n) / RATE)[:, None, None]
    acc = np.array([0.0, GRAVITY, 0.0]) + 3.0 * swing + rng.normal(0.0, 0.05, (n, 2, 3))
    gyr = 2.0 * swing + rng.normal(0.0, 0.01, (n, 2, 3))
    for x in (acc, gyr):
        x[FROZEN_AT : FROZEN_AT + 200, 1] = x[FROZEN_AT, 1]
    return acc, gyr


def run(size: int) -> tuple[list[UniformBlock], list[Notice], StuckSensors, list[tuple[Segment, ...]]]:
    acc, gyr = signals()
    mask = np.ones((size, 2), np.bool_)
    watch = StuckSensors(("pelvis", "foot_l"), RATE)
    blocks, notices, now = [], [], []
    for k in range(0, len(acc), size):
        part = slice(k, k + size)
        t_s = np.arange(k, k + size) / RATE
        block, frame = watch.push(UniformBlock(k, t_s, acc[part], gyr[part], mask, mask))
        blocks.append(block)
        notices += frame
        now.append(watch.now)
    return blocks, notices, watch, now


@pytest.mark.parametrize("size", [10, 50])
def test_a_frozen_sensor_is_left_out_told_once_and_taken_in_again(size: int) -> None:
    blocks, notices, watch, now = run(size)
    assert [(n.code, n.sensor) for n in notices] == [("sensor_frozen", "foot_l")]
    assert notices[0].t_s == pytest.approx(FROZEN_AT / RATE, abs=0.02)
    valid: Bools = np.concatenate([b.valid for b in blocks])
    assert valid[:, 0].all()
    lost = np.flatnonzero(~valid[:, 1])
    assert np.array_equal(np.concatenate([b.interpolated for b in blocks]), valid)
    # known once it has lasted, and until the next new sample
    assert FROZEN_AT < lost[0] < FROZEN_AT + 100
    assert np.array_equal(lost, np.arange(lost[0], FROZEN_AT + 200))
    assert watch.now == ()
    assert set(now) == {(), ("foot_l",)}


def test_left_out_for_good_is_told_from_a_pause() -> None:
    """Frozen sensors may recover; only stuck or clipped ones are excluded."""
    blocks, _, _, _ = run(50)
    for block in blocks:
        assert block.out is not None
        assert block.out.shape == block.valid.shape
        assert not block.out.any()


def test_a_dead_axis_is_out_from_when_it_is_known() -> None:
    acc, gyr = signals()
    gyr[:, 0, 1] = 0.013
    mask = np.ones(acc.shape[:2], np.bool_)
    watch = StuckSensors(("pelvis", "foot_l"), RATE)
    block, notices = watch.push(UniformBlock(0, np.arange(len(acc)) / RATE, acc, gyr, mask, ~mask))
    assert ("channel_stuck", "pelvis") in [(n.code, n.sensor) for n in notices]
    assert watch.now == ("pelvis",)
    assert block.out is not None
    assert np.array_equal(block.out[:, 0], ~block.valid[:, 0])
    assert not block.out[:, 1].any()
    assert not block.interpolated.any()
