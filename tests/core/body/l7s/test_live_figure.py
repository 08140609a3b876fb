"""The live figure of three or two sensors: who stands, what is not known, and how it ends."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body.erkf.live_erkf import live_params
from sagittal.core.body.erkf.live_sensors import FilteredSensors, FootPaths
from sagittal.core.body.l7s.legs import FIGURE, LegModel
from sagittal.core.body.l7s.live_figure import LiveL7s
from sagittal.core.body.live_estimator import BodyBlock, MeasuredBlock
from sagittal.core.frames import Segment
from tests.core.body.live_standing import BODY, NEUTRAL, RATE, mounted, stand

THREE: tuple[Segment, ...] = ("foot_r", "pelvis", "foot_l")


def figure(*segments: Segment) -> LiveL7s:
    column, reference = {s: i for i, s in enumerate(segments)}, mounted(*segments)
    feet = FootPaths(FilteredSensors(("foot_l", "foot_r"), column, reference, BODY, RATE, live_params()))
    return LiveL7s(column, reference, BODY, RATE, feet)


@pytest.mark.parametrize(("worn", "method"), [(THREE, "l7s_3i"), (("foot_l", "foot_r"), "l7s_2i")])
def test_who_stands_is_drawn_straight(worn: tuple[Segment, ...], method: str) -> None:
    live = figure(*worn)
    assert live.method == method
    assert set(live.attitudes) >= set(worn)
    block = live.push(stand(100, *worn))
    assert block.q.shape == (100, len(FIGURE), 4)
    assert block.known.all()
    assert block.whole.all()
    places = dict(zip(live.segments, block.p[-1], strict=True))
    assert places["pelvis"][2] == pytest.approx(LegModel.of(BODY).hip_height, abs=0.01)
    assert places["foot_l"][1] - places["foot_r"][1] == pytest.approx(BODY.hip_width, abs=0.01)
    turned = np.abs((block.q[-1] * NEUTRAL).sum(axis=1))
    assert turned == pytest.approx(1.0, abs=2e-3)
    assert block.paths.still[-1].all()
    assert live.drain_notices() == []
    assert not live.broken


def test_a_lost_sensor_makes_the_figure_unknown() -> None:
    live = figure(*THREE)
    live.push(stand(100, *THREE))
    lost = stand(20, *THREE)
    lost.valid[5:10, 1] = False
    block = live.push(lost)
    assert block.whole.tolist() == [True] * 5 + [False] * 5 + [True] * 10
    assert block.known.all(axis=1).tolist() == block.whole.tolist()


def broken_at(k: int) -> MeasuredBlock:
    """Standing until an orientation is no number."""
    block = stand(20, *THREE)
    block.turned["pelvis"][k:] = np.nan
    return block


def test_what_cannot_be_followed_ends_it_from_that_sample_on_however_the_samples_come() -> None:
    whole = figure(*THREE)
    whole.push(stand(100, *THREE))
    block = whole.push(broken_at(7))
    assert block.whole.tolist() == [True] * 7 + [False] * 13
    assert np.isfinite(block.p[:7]).all()
    assert np.isnan(block.p[7:, 0]).all()
    assert whole.broken
    assert not whole.push(stand(5, *THREE)).whole.any()
    parts = figure(*THREE)
    parts.push(stand(100, *THREE))
    broken = broken_at(7)
    result: list[BodyBlock] = []
    for a, b in ((0, 3), (3, 9), (9, 20)):
        turned = {s: x[a:b] for s, x in broken.turned.items()}
        k = slice(a, b)
        part = MeasuredBlock(broken.acc[k], broken.gyr[k], broken.valid[k], turned, broken.filled[k])
        result.append(parts.push(part))
    np.testing.assert_array_equal(np.concatenate([x.p for x in result]), block.p)
