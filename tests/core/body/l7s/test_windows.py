"""A take of L7S in windows: what the filter says does not change, what is solved changes by the margin."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body import poses
from sagittal.core.body.l7s import windows
from sagittal.core.body.l7s.windows import cut_windows
from sagittal.core.body.poses import Poses
from sagittal.core.frames import FOOT, SHANK, SIDES
from sagittal.core.signals import held_samples
from tests.core.body.l7s.test_poses import poses_of


@pytest.fixture
def short_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(windows, "WHOLE", 1000)
    monkeypatch.setattr(poses, "SHORT", 1000)
    monkeypatch.setattr(held_samples, "SHORT", 1000)
    monkeypatch.setattr(windows, "LONG", 1000)


def compare(result: Poses, whole: Poses) -> tuple[float, float]:
    """Largest difference in m of any place, and of a knee from its ankle."""
    apart = {s: result.p[s] - whole.p[s] for s in whole.p}
    legs = (np.abs(apart[SHANK[side]] - apart[FOOT[side]]).max() for side in SIDES)
    return max(float(np.abs(x).max()) for x in apart.values()), float(max(legs))


@pytest.mark.parametrize(("samples", "rate_hz", "hop"), [(70_001, 100.0, 2), (200_000, 60.0, 1)])
def test_windows_cover_a_take_once_and_begin_on_its_nodes(samples: int, rate_hz: float, hop: int) -> None:
    cut = cut_windows(samples, rate_hz)
    assert len(cut) > 1
    own = [(solved.start + own.start, solved.start + own.stop) for solved, own in cut]
    assert [first for first, _ in own] == [0, *(past for _, past in own[:-1])]
    assert own[-1][1] == samples
    assert all(solved.start % hop == 0 for solved, _ in cut)
    for (solved, _), (first, past) in zip(cut, own, strict=True):
        assert solved.start <= first < past <= solved.stop


def test_the_filter_says_the_same_in_windows(short_windows: None, monkeypatch: pytest.MonkeyPatch) -> None:
    result = poses_of("3I", both_ways=False)
    monkeypatch.undo()
    whole = poses_of("3I", both_ways=False)
    assert {x.dtype.name for x in (*result.q.values(), *result.p.values())} == {"float32"}
    for s in whole.p:
        np.testing.assert_array_equal(result.q[s], whole.q[s].astype(np.float32))
        np.testing.assert_array_equal(result.p[s], whole.p[s].astype(np.float32))
    assert result.diagnostics == whole.diagnostics
    np.testing.assert_array_equal(result.valid, whole.valid)


def test_places_in_windows_are_those_of_the_whole_take(
    short_windows: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(windows, "AROUND_S", 10.0)
    result = poses_of("2I")
    monkeypatch.undo()
    whole = poses_of("2I")
    anywhere, knee = compare(result, whole)
    # twelve times the margin leaves 1 mm
    assert anywhere < 0.1
    assert knee < 0.005
