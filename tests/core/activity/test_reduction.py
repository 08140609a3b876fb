"""Samples to frames: rate of the axis, slabs, holes, refusals, and up by the gyroscope."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from sagittal.core.activity.frames import Slab
from sagittal.core.activity.params import ActivityParams
from sagittal.core.activity.reduction import follow_up, reduce_stream, working_rate
from sagittal.core.errors import SignalError
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.rotation import about, conjugate, rotate
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock

PARAMS = ActivityParams(slab_s=60, margin_s=5)


@pytest.mark.parametrize(
    ("measured", "axis"),
    [(100.0, 100), (100.05, 100), (102.4, 110), (50.0, 50), (25.0, 30), (31.25, 40), (5.0, 20)],
)
def test_a_frame_holds_a_whole_number_of_samples_of_the_axis(measured: float, axis: int) -> None:
    assert working_rate(measured) == axis


def stream(t_s: Floats, acc: Floats, rows: int = 1000) -> LongStream:
    def open_blocks() -> Iterator[SampleBlock]:
        for i in range(0, len(t_s), rows):
            yield SampleBlock(t_s[i : i + rows], acc[i : i + rows], None)

    return LongStream("D1", "day.cwa", 20.0, False, float(t_s[-1]), open_blocks)


def resting(seconds: float) -> tuple[Floats, Floats]:
    t_s = np.arange(round(20 * seconds)) / 20
    return t_s, np.tile([0.0, 3.0, 4.0], (len(t_s), 1))


def reduce(inputs: LongStream) -> list[Slab]:
    return list(reduce_stream(inputs, "chest", PARAMS))


def test_a_resting_sensor_gives_its_own_gravity_in_slabs_of_one_length() -> None:
    slabs = reduce(stream(*resting(150)))
    assert [(s.frames.first, len(s.frames.valid)) for s in slabs] == [(0, 600), (600, 600), (1200, 300)]
    for slab in slabs:
        x = slab.frames
        assert x.valid.all()
        assert x.gravity == pytest.approx(np.tile([0.0, 3.0, 4.0], (len(x.valid), 1)), abs=2e-2)
        assert x.up == pytest.approx(5.0, abs=2e-2)
        assert x.spread == pytest.approx(0.0, abs=1e-9)
        assert (slab.steps_s, slab.turns) == ((), ())
    assert [len(s.frames.sd) for s in slabs] == [1, 1, 1]
    assert slabs[0].frames.sd[0] == pytest.approx(0.0, abs=1e-6)
    # half a minute of a minute is enough, not less
    assert np.isfinite(slabs[2].frames.wobble).all()
    assert np.isnan(reduce(stream(*resting(149)))[2].frames.sd).all()


def test_a_hole_leaves_frames_that_are_not_valid_and_a_slab_of_nothing_is_empty() -> None:
    t_s, acc = resting(200)
    retained = (t_s < 30.0) | (t_s >= 130.0)
    slabs = reduce(stream(t_s[retained], acc[retained], rows=77))
    valid = np.concatenate([s.frames.valid for s in slabs])
    assert len(valid) == 2000
    assert valid[:298].all()
    assert not valid[302:1299].any()
    assert valid[1302:].all()
    assert np.isnan(slabs[1].frames.sd).all()
    assert not slabs[1].frames.gravity.any()


def test_blocks_do_not_matter() -> None:
    t_s, acc = resting(100)
    acc = acc + np.sin(t_s)[:, None]
    one, second = reduce(stream(t_s, acc)), reduce(stream(t_s, acc, rows=33))
    for a, b in zip(one, second, strict=True):
        np.testing.assert_array_equal(a.frames.gravity, b.frames.gravity)
        np.testing.assert_array_equal(a.frames.spread, b.frames.spread)


def test_rows_that_go_back_in_time_are_left_out() -> None:
    t_s, acc = resting(100)
    backwards = t_s.copy()
    backwards[500:510] -= 10.0
    bent = acc.copy()
    bent[500:510] = 50.0
    assert max(float(s.frames.spread.max()) for s in reduce(stream(backwards, bent))) < 1e-6


def test_a_file_without_a_sample_or_with_a_clock_that_jumped_is_refused() -> None:
    t_s, acc = resting(10)
    with pytest.raises(SignalError, match="no complete sample") as empty:
        reduce(stream(t_s, np.full_like(acc, np.nan)))
    assert (empty.value.code, empty.value.sensor) == ("bad_signal", "D1")
    far = t_s.copy()
    far[-1] = 61 * 86400.0
    with pytest.raises(SignalError, match="61 days; at most 60") as jumped:
        reduce(stream(far, acc))
    assert (jumped.value.code, jumped.value.sensor) == ("clock_jump", "D1")


def test_up_follows_the_gyroscope_and_loses_its_bias_while_quiet() -> None:
    t = np.arange(400) / 50
    turn = np.where(t < 2.0, 0.0, 1.0 * (t - 2.0))
    up = rotate(conjugate(about(1, turn)), np.array([0.0, 0.0, 1.0]))
    gyr = np.zeros((len(t), 3))
    gyr[t >= 2.0, 1] = 1.0
    # what it feels on the way is no gravity
    acc = GRAVITY * up
    acc[t >= 2.0] += np.array([8.0, 0.0, 0.0])
    bias = np.array([0.02, -0.03, 0.04])
    result = follow_up(acc, gyr + bias, up, 50.0)
    assert np.linalg.norm(result, axis=1) == pytest.approx(1.0)
    angle = np.degrees(np.arccos(np.clip((result * up).sum(axis=1), -1.0, 1.0)))
    assert angle.max() < 3.0
