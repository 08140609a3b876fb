"""Data passed between the stages of the chain."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, radians

import numpy as np
import pytest

from sagittal.core import calibration
from sagittal.core.body.erkf.headings import turn_forward_axes
from sagittal.core.calibration import CalibrationParams, calibrate
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.parameters.smoothness import NAME as SPARC
from sagittal.core.parameters.trunk import NAMES as TRUNK_NAMES
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.rotation import to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import simulate_scenario, simulate_tug
from tests.helpers.walks import analysed

OFF_DEG = 20.0

OF_TRUNK = (*TRUNK_NAMES, SPARC)
"""What is measured on the trunk's acceleration."""


@pytest.fixture(scope="module")
def right() -> TakeAnalysis:
    """A simulated walk as the product analyses it."""
    return analysed("comfortable", 0)


@pytest.fixture(scope="module")
def off() -> TakeAnalysis:
    """The same walk, the pelvis taken to face 20° to the left of where it does."""

    def calibrate_wrongly(
        recording: UniformRecording, params: CalibrationParams | None = None
    ) -> CalibratedRecording:
        good = calibrate(recording, params)
        wrong, _ = turn_forward_axes(good, estimate_orientations(good), {"pelvis": radians(OFF_DEG)})
        return wrong

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibration, "calibrate", calibrate_wrongly)
        return analyse(simulate_scenario("comfortable", 0).recording)


@pytest.mark.slow
def test_the_trunk_of_a_pelvis_20_degrees_off_is_as_regular_as_of_one_that_is_not(
    right: TakeAnalysis, off: TakeAnalysis
) -> None:
    assert any(n.code == "heading_corrected" and n.sensor == "pelvis" for n in off.notices)
    assert right.tracks is not None
    assert off.tracks is not None
    was, now = right.tracks.trunk["pelvis"], off.tracks.trunk["pelvis"]
    for axis in range(3):
        assert np.corrcoef(was[:, axis], now[:, axis])[0, 1] > 0.995, axis
    reference, result = ({p.name: p.mean for p in x.parameters if p.name in OF_TRUNK} for x in (right, off))
    assert set(result) == set(OF_TRUNK)
    for name, value in result.items():
        # a ratio of what repeats to what hardly does moves with the last degree
        assert value == pytest.approx(reference[name], rel=0.3 if "harmonic" in name else 0.02), name


@pytest.mark.slow
def test_the_mounting_that_is_told_is_the_one_that_was_used(right: TakeAnalysis, off: TakeAnalysis) -> None:
    assert right.calibration is not None
    assert off.calibration is not None
    was = right.calibration.segments["pelvis"].R_segment_sensor
    now = off.calibration.segments["pelvis"].R_segment_sensor
    turn = degrees(np.arccos(np.clip((np.trace(was @ now.T) - 1.0) / 2.0, -1.0, 1.0)))
    assert turn < 3.0


@pytest.mark.slow
def test_a_chest_sensor_worn_on_a_walk_gets_an_axis_of_its_own() -> None:
    simulation = simulate_tug()
    walked = replace(simulation.recording, protocol="walk")
    analysis = analyse(walked)
    assert analysis.calibration is not None
    chest = analysis.calibration.segments["chest"].R_segment_sensor
    off = chest @ to_matrix(simulation.truth.mounts["chest"].q_segment_sensor).T
    assert degrees(np.arccos((np.trace(off) - 1.0) / 2.0)) < 12.0
    without = {d: None if s == "chest" else s for d, s in walked.segments.items()}
    assert len(analysis.parameters) == len(analyse(replace(walked, segments=without)).parameters)
