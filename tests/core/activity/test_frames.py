"""Frames are kept in order, dropped by the minute, and seen up to a moment."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.activity.frames import PER_MINUTE, FrameStore, measure_length
from tests.core.activity.frames_of_day import make_frames


def fill(store: FrameStore, count: int, value: float) -> None:
    store.append(make_frames(count, spread=value, moved=value))


def test_what_was_appended_is_seen_in_order() -> None:
    store = FrameStore(3 * PER_MINUTE)
    fill(store, 600, 1.0)
    fill(store, 600, 2.0)
    fill(store, 300, 3.0)
    assert store.end == 1500
    view = store.view(1300)
    assert view.first == 0
    assert len(view.valid) == len(view.gravity) == len(view.up) == 1300
    assert view.spread[[0, 599, 600, 1199, 1200]].tolist() == [1.0, 1.0, 2.0, 2.0, 3.0]
    assert view.sd[:, 0].tolist() == view.wobble[:, 2].tolist() == [1.0, 2.0, 3.0]
    assert len(store.view(1200).sd) == 2
    assert len(store.view(9999).valid) == 1500, "not beyond what is kept"


def test_dropped_frames_make_room_and_the_rest_keeps_its_numbers() -> None:
    store = FrameStore(3 * PER_MINUTE)
    for value in (1.0, 2.0, 3.0):
        fill(store, 600, value)
    store.drop_before(600)
    assert store.end == 1800
    fill(store, 600, 4.0)
    view = store.view(store.end)
    assert (view.first, len(view.valid)) == (600, 1800)
    assert view.spread[[0, 600, 1200]].tolist() == [2.0, 3.0, 4.0]
    assert view.sd[:, 1].tolist() == [2.0, 3.0, 4.0]


def test_dropping_again_or_too_early_changes_nothing() -> None:
    store = FrameStore(2 * PER_MINUTE)
    fill(store, 600, 1.0)
    fill(store, 300, 2.0)
    store.drop_before(-600)
    assert store.view(900).first == 0
    for _ in range(2):
        store.drop_before(600)
        view = store.view(900)
        assert (view.first, view.spread.tolist(), view.sd[:, 0].tolist()) == (600, [2.0] * 300, [2.0])
    store.drop_before(6000)
    assert store.end == 900
    assert len(store.view(900).valid) == 0


def test_lengths_are_summed_in_double_precision() -> None:
    lengths = measure_length(np.array([[3.0, 4.0, 12.0], [0.0, 0.0, -2.0]], np.float32))
    assert lengths.dtype == np.float64
    assert lengths == pytest.approx([13.0, 2.0])
