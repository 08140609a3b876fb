"""Trembling legs: in turn, within its time, and gone over a period."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.simulate.gait.tremor import EDGE_S, Tremor, tremble_sensor

T = np.arange(1000) / 100.0
TREMOR = Tremor(2.0, 8.0, 5.0, 0.05)


def test_the_feet_tremble_in_turn_and_the_pelvis_not_at_all() -> None:
    left, right = (tremble_sensor(T, s, (TREMOR,)) for s in ("foot_l", "foot_r"))
    assert np.allclose(left[1], -right[1])
    assert np.abs(left[1]).max() == pytest.approx(0.05, rel=0.01)
    for shift, turn in (tremble_sensor(T, "pelvis", (TREMOR,)), tremble_sensor(T, "foot_l", ())):
        assert not shift.any()
        assert not turn.any()


def test_it_begins_and_ends_smoothly() -> None:
    shift, turn = tremble_sensor(T, "shank_r", (TREMOR,))
    outside = (T <= 2.0) | (T >= 8.0)
    assert not turn[outside].any()
    assert not shift[outside].any()
    assert np.abs(turn[(T > 2.0) & (T < 2.0 + EDGE_S / 3.0)]).max() < 0.2 * np.abs(turn).max()
    assert not shift[:, :2].any(), "it rises and falls"
    assert turn[(T > 3.0) & (T <= 7.0)].mean() == pytest.approx(0.0, abs=1e-4)
