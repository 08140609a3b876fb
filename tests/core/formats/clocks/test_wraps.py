"""Wraps of clocks and counters."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.formats.clocks.wraps import find_wrap, unwrap


@pytest.mark.parametrize("wrap", [86400.0, 43200.0, 3600.0, 512.0, 4294.967296])
def test_the_range_of_a_clock_is_found(wrap: float) -> None:
    t = np.mod(wrap - 7.0 + np.arange(2000) * 0.01, wrap)
    found = find_wrap(t, 0.01, 1, 0.0, seconds=True)
    assert found is not None
    assert found[0] == pytest.approx(wrap)
    np.testing.assert_allclose(np.diff(unwrap(t, found[0])), 0.01, atol=1e-9)


def test_a_restart_is_no_wrap() -> None:
    t = np.concatenate((np.arange(6000) * 0.01, np.arange(500) * 0.01))
    t[:6000] *= 57.3 / 60.0
    assert find_wrap(t, 0.01, 1, 1e-3, seconds=True) is None
