"""Declared mountings in words."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.calibration.mounting import read_declared_angle, read_declared_direction
from sagittal.core.calibration.standing import vertical_frame


@pytest.mark.parametrize(
    ("text", "axis", "degrees"),
    [
        ("sacrum, face backwards", (0, 0, 1), 180),
        ("face to the back", (0, 0, 1), 180),
        ("Facing forward", (0, 0, 1), 0),
        ("lateral, face right", (0, 0, 1), -90),
        ("faces left", (0, 0, 1), 90),
        ("x forward", (1, 0, 0), 0),
        ("-y axis rear", (0, -1, 0), 180),
    ],
)
def test_words_become_a_direction(text: str, axis: tuple[int, int, int], degrees: float) -> None:
    result = read_declared_direction(text)
    assert result is not None
    np.testing.assert_allclose(result[0], axis)
    assert np.degrees(result[1]) == pytest.approx(degrees)


@pytest.mark.parametrize("text", ["", "sacrum", "with tape", "surface forwarded by mail"])
def test_words_that_say_nothing_are_nothing(text: str) -> None:
    assert read_declared_direction(text) is None


def test_an_axis_along_the_vertical_says_nothing() -> None:
    assert read_declared_angle("face forward", vertical_frame(np.array([0.0, 0.0, 1.0])), "pelvis") is None


def test_angle_is_that_of_anterior_in_the_rest_world() -> None:
    """A sensor upright (y up) with its face (z) backwards: anterior is −z, which in the rest world is +y."""
    R = vertical_frame(np.array([0.0, 1.0, 0.0]))
    angle = read_declared_angle("face backwards", R, "pelvis")
    assert angle is not None
    v = R @ np.array([0.0, 0.0, -1.0])
    assert angle == pytest.approx(np.arctan2(-v[2], v[0]))
