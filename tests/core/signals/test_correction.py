"""Corrections of axes and units."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sagittal.core.errors import ManifestError, ParameterError
from sagittal.core.formats import parse_manifest
from sagittal.core.signals.correction import SensorCorrection, name_axes, to_axes_matrix
from tests.helpers.setup_mistakes import SIGNED

VALUES = np.array([[1.0, 2.0, 3.0]])


def test_the_right_axis_is_the_named_one_as_read() -> None:
    np.testing.assert_allclose(SensorCorrection(acc_axes=("-y", "x", "z")).correct_acc(VALUES), [[-2, 1, 3]])
    np.testing.assert_allclose(SensorCorrection(gyr_times=2.0).correct_gyr(VALUES), 2 * VALUES)


@pytest.mark.parametrize("matrix", SIGNED)
def test_names_and_matrix_say_the_same(matrix: np.ndarray) -> None:
    np.testing.assert_array_equal(to_axes_matrix(name_axes(matrix)), matrix)


def test_corrections_follow_each_other() -> None:
    first = SensorCorrection(acc_axes=("y", "z", "x"), gyr_axes=("-x", "-y", "-z"), acc_times=2.0)
    second = SensorCorrection(acc_axes=("-y", "x", "z"), gyr_axes=("y", "x", "z"), gyr_times=3.0)
    both = second.follow(first)
    np.testing.assert_allclose(both.correct_acc(VALUES), second.correct_acc(first.correct_acc(VALUES)))
    np.testing.assert_allclose(both.correct_gyr(VALUES), second.correct_gyr(first.correct_gyr(VALUES)))


@pytest.mark.parametrize("bad", [{"acc_axes": ("x", "x", "z")}, {"gyr_axes": ("x", "y")}, {"acc_times": 0.0}])
def test_what_is_no_correction_is_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match="expected"):
        SensorCorrection(**bad)  # type: ignore[arg-type]


def test_a_manifest_says_it_and_names_the_place_of_a_mistake() -> None:
    said = {"corrections": {"A": {"acc_axes": ["-x", "y", "z"], "gyr_times": 0.5}}}
    found = parse_manifest(json.dumps(said).encode()).corrections["A"]
    assert found == SensorCorrection(acc_axes=("-x", "y", "z"), gyr_times=0.5)
    assert found.to_json() == said["corrections"]["A"]
    with pytest.raises(ManifestError, match=r"corrections\.A: acc_axes"):
        parse_manifest(b'{"corrections": {"A": {"acc_axes": ["-x", "x", "z"]}}}')
