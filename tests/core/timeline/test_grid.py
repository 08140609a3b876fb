"""Points of the axis from samples at their own times: copied, interpolated, filled or held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import Bools, Floats
from sagittal.core.timeline.grid import lay_signal
from sagittal.core.timeline.params import TimelineParams

RATE = 100.0


def lay(
    t_s: Floats, samples: int, start_s: float = 0.0, params: TimelineParams | None = None
) -> tuple[Floats, Bools, Bools]:
    """A signal that is its own time in every channel, the second group its negative."""
    x = np.concatenate((np.tile(t_s[:, None], 3), -np.tile(t_s[:, None], 3)), axis=1)
    return lay_signal(t_s, x, start_s, samples, RATE, RATE, params or TimelineParams())


def test_samples_on_the_axis_are_copied_and_those_beside_it_interpolated() -> None:
    t_s = np.arange(6) / RATE
    values, valid, filled = lay(t_s, 6)
    assert np.array_equal(values[0], np.tile(t_s[:, None], 3))
    assert np.array_equal(values[1], -values[0])
    assert valid.all()
    assert not filled.any()
    values, valid, filled = lay(t_s, 5, start_s=0.004)
    assert values[0, :, 1] == pytest.approx(t_s[:5] + 0.004, abs=1e-15)
    assert valid.all()
    # between neighbours nothing is missing
    assert not filled.any()


@pytest.mark.parametrize(
    ("beside", "copied"), [(0.009, True), (-0.009, True), (0.011, False), (-0.011, False)]
)
def test_a_sample_a_hundredth_beside_the_axis_counts_as_on_it(beside: float, copied: bool) -> None:
    t_s = np.arange(6) / RATE + beside / RATE
    values, _, _ = lay(t_s, 6)
    assert bool(values[0, 2, 0] == t_s[2]) is copied


@pytest.mark.parametrize(("missing", "is_filled"), [(1, True), (10, True), (11, False)])
def test_a_hole_is_filled_up_to_a_tenth_of_a_second_and_held_beyond(missing: int, is_filled: bool) -> None:
    t_s = np.delete(np.arange(30) / RATE, np.arange(5, 5 + missing))
    values, valid, filled = lay(t_s, 30)
    hole = np.arange(5, 5 + missing)
    assert np.flatnonzero(filled).tolist() == (hole.tolist() if is_filled else [])
    assert np.flatnonzero(~valid).tolist() == ([] if is_filled else hole.tolist())
    expected = hole / RATE if is_filled else np.full(missing, 4 / RATE)
    assert values[0, hole, 0] == pytest.approx(expected, abs=1e-15)


def test_the_longest_hole_is_a_parameter() -> None:
    t_s = np.delete(np.arange(30) / RATE, np.arange(5, 9))
    _, valid, filled = lay(t_s, 30, params=replace(TimelineParams(), max_gap_s=0.03))
    assert not filled.any()
    assert np.count_nonzero(~valid) == 4


def test_before_the_first_and_after_the_last_sample_nothing_is_valid() -> None:
    values, valid, filled = lay(np.arange(3, 6) / RATE, 9)
    assert np.flatnonzero(valid).tolist() == [3, 4, 5]
    assert not filled.any()
    assert values[0, :, 2] == pytest.approx(np.array([3, 3, 3, 3, 4, 5, 5, 5, 5]) / RATE)
