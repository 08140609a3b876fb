"""Step of a column of stamps."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.formats.clocks.step import find_packets, is_bursty


@pytest.mark.parametrize(("size", "rate"), [(1, 100.0), (3, 104.0), (8, 204.8), (100, 99.7)])
def test_the_step_of_a_row_is_found_whatever_shares_a_stamp(size: int, rate: float) -> None:
    t = (np.arange(4000) // size) * size / rate
    found = find_packets(t)
    assert found.usual == size
    assert found.step == pytest.approx(1 / rate, rel=1e-3)


def test_bursts_are_told_from_losses() -> None:
    n = np.arange(2000)
    assert is_bursty((n // 8) * 0.08 + (n % 8) * 1e-4)
    t = np.delete(n * 0.01, np.arange(500, 900))
    assert not is_bursty(t)
