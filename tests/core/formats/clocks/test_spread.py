"""Times of rows that share stamps."""

from __future__ import annotations

import numpy as np

from sagittal.core.formats.clocks.spread import spread_rows


def test_packets_are_spread_and_a_lost_one_is_a_hole() -> None:
    stamps = np.delete(np.arange(200) * 0.08, 100)
    widths = np.full(199, 8)
    found = spread_rows(stamps, widths, np.zeros(199, np.bool_), 0.01, 8)
    steps = np.diff(found.ticks)
    assert np.flatnonzero(steps > 0.05).tolist() == [799]
    np.testing.assert_allclose(np.delete(steps, 799), 0.01, atol=2e-4)


def test_a_row_for_which_the_clock_has_no_time_is_left_out() -> None:
    stamps, widths = np.arange(100.0) * 0.01, np.ones(100, np.int64)
    widths[50] = 2
    found = spread_rows(stamps, widths, np.zeros(100, np.bool_), 0.01, 1)
    assert np.flatnonzero(found.extra).tolist() == [51]
