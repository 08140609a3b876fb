"""Strides counted one by one give the mean and sd of all of them."""

from __future__ import annotations

from statistics import fmean, stdev

import pytest

from sagittal.core.feedback.cue import Summary
from sagittal.core.feedback.tally import RunningStatistics


def test_without_strides_nothing_is_known() -> None:
    assert RunningStatistics().summary == Summary(0, None, None, None)


def test_one_stride_has_no_spread() -> None:
    notices = RunningStatistics()
    notices.add(0.5, False)
    assert notices.summary == Summary(1, 0.5, None, 0.0)


def test_the_running_figures_are_those_of_all_strides() -> None:
    values = [1e6 + x for x in (0.1, 0.4, 0.35, 0.2, 0.9)]
    notices = RunningStatistics()
    for i, value in enumerate(values):
        notices.add(value, inside=i < 2)
    summary = notices.summary
    assert summary.n == 5
    assert summary.mean == pytest.approx(fmean(values), abs=1e-9)
    assert summary.sd == pytest.approx(stdev(values), rel=1e-6)
    assert summary.in_zone == 0.4
