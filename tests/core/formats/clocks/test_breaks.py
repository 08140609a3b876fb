"""Lasting breaks of a clock."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.formats.clocks.breaks import mend_breaks

T = 100.0 + np.arange(4000.0) * 0.01


@pytest.mark.parametrize("jump", [512.0, 3600.0, -3600.0, 86400.0, -1800.0])
def test_a_jump_that_explains_itself_is_taken_back(jump: float) -> None:
    x = T + 10_000.0 + jump * (np.arange(4000) >= 1500)
    found = mend_breaks(x, 0.01, 1, seconds=True, wrap=None)
    assert [r.code for r in found.repairs] == ["clock_leap"]
    np.testing.assert_allclose(np.diff(found.stamps), 0.01, atol=1e-6)


def test_a_gap_stays_and_a_restart_is_found() -> None:
    gap = T + np.where(np.arange(4000) >= 1500, 20.0, 0.0)
    found = mend_breaks(gap, 0.01, 1, seconds=True, wrap=None)
    assert not found.repairs
    np.testing.assert_array_equal(found.stamps, gap)
    again = np.concatenate((T[:2000], T[:2000]))
    assert mend_breaks(again, 0.01, 1, seconds=True, wrap=None).restart == 2000


def test_a_few_stamps_far_from_all_others_are_left_out() -> None:
    x = T.copy()
    x[:3], x[2000] = 0.0, 1e9
    found = mend_breaks(x, 0.01, 1, seconds=True, wrap=None)
    assert np.flatnonzero(np.isnan(found.stamps)).tolist() == [0, 1, 2, 2000]


def test_a_narrow_counter_that_falls_back_has_lost_more_than_half_its_range() -> None:
    counts = np.arange(3000.0)
    counts[1500:] += 200 - 256
    found = mend_breaks(counts, 1.0, 1, seconds=False, wrap=256.0)
    assert found.stamps[1500] - found.stamps[1499] == 201.0
