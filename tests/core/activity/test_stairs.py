"""Stairs distinguished from level walking by personal limits."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.activity.params import StairParams
from sagittal.core.activity.stairs import calibrate_stairs, tell_stairs
from sagittal.core.errors import ParameterError


def test_stairs_are_told_by_a_persons_own_limits() -> None:
    level, up, down = (
        (np.full(30, r), np.full(30, x)) for r, x in ((0.005, 0.0), (0.02, 0.05), (0.015, 0.01))
    )
    rocks, lean = (np.concatenate([kind[i] for kind in (level, up, down)]) for i in (0, 1))
    assert not tell_stairs(rocks, lean, StairParams()).any()
    own = calibrate_stairs(level, up, down)
    assert np.bincount(tell_stairs(rocks, lean, own)).tolist() == [30, 30, 30]


def test_stairs_like_level_walking_cannot_be_calibrated() -> None:
    same = (np.full(30, 0.01), np.zeros(30))
    with pytest.raises(ParameterError, match="Expected more on stairs") as error:
        calibrate_stairs(same, same, same)
    assert error.value.code == "stairs_not_told_apart"
