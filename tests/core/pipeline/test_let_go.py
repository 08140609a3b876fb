"""Data that no later stage reads are released, nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.agreement import Agreement
from sagittal.core.errors import ParameterError
from sagittal.core.pipeline.analysis import TakeAnalysis
from sagittal.core.pipeline.let_go import (
    forget_magnetometers,
    keep_refined_alone,
    keep_what_is_measured,
    keep_what_poses_read,
)
from sagittal.core.signals.recording import ImuStream, Recording, SensorSignals, Subject, UniformRecording

N = 5
T_S = np.arange(N) / 100.0


def signal() -> np.ndarray:
    return np.ones((N, 3))


def uniform() -> UniformRecording:
    sensor = SensorSignals("A", signal(), signal(), signal(), np.ones(N, np.bool_), np.zeros(N, np.bool_))
    return UniformRecording(T_S, 100.0, {"pelvis": sensor}, Subject(), "walk", {})


def source() -> Recording:
    stream = ImuStream("A", "a.txt", T_S, signal(), signal(), signal(), None, 100.0, "index", "")
    return Recording({"A": stream}, {"A": "pelvis"})


def test_magnetometers_are_forgotten_wherever_an_analysis_holds_them() -> None:
    analysis = TakeAnalysis(source(), uniform=uniform(), agreed=Agreement(uniform(), whole=uniform()))
    left = forget_magnetometers(analysis)
    assert left.uniform is not None
    assert left.agreed is not None
    assert left.agreed.whole is not None
    held = [x.sensors["pelvis"] for x in (left.uniform, left.agreed.recording, left.agreed.whole)]
    assert left.source.streams["A"].mag is None
    np.testing.assert_array_equal(left.source.streams["A"].acc, signal())
    for retained in held:
        assert retained.mag is None
        np.testing.assert_array_equal(retained.acc, signal())
        np.testing.assert_array_equal(retained.gyr, signal())


def test_an_analysis_without_a_time_axis_has_only_its_streams_to_let_go_of() -> None:
    left = forget_magnetometers(TakeAnalysis(source()))
    assert (left.source.streams["A"].mag, left.uniform, left.agreed) == (None, None, None)


@pytest.mark.parametrize("let_go", [keep_what_poses_read, keep_refined_alone, keep_what_is_measured])
def test_orientations_are_let_go_of_only_behind_the_stage_that_gives_them(let_go) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ParameterError) as caught:
        let_go(TakeAnalysis(source()))
    assert caught.value.code == "stage_not_reached"
