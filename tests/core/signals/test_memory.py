"""Arrays with pages of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sagittal.core.signals.memory import make_pages


def held_mb() -> float:
    status = Path("/proc/self/status").read_text().splitlines()
    return int(next(x for x in status if x.startswith("RssAnon")).split()[1]) / 1024


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_pages_are_taken_when_written_and_go_back_with_the_last_who_holds_them() -> None:
    before = held_mb()
    pages = make_pages(8, 1 << 20)
    assert not pages[3].any()
    assert held_mb() - before < 8.0
    pages[:4] = 1.0
    part = pages[1:2]
    assert held_mb() - before == pytest.approx(32.0, abs=8.0)
    del pages
    np.testing.assert_array_equal(part, 1.0)
    del part
    assert held_mb() - before < 8.0


def test_nothing_takes_a_page_and_is_an_array_all_the_same() -> None:
    assert make_pages(7, 0).shape == (7, 0)
