"""A take with one trunk sensor, whole chain: cadence, steps, walking bouts and turns, no joint angles."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from sagittal.core.calibration import CalibrationParams
from sagittal.core.calibration.sensor_in_walk import WalkRungParams
from sagittal.core.frames import Segment
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.parameters.result import Parameter
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.simulate import simulate_scenario
from sagittal.server.report.files.bundle import load_bundle
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.files.tracks import NAME, read_tracks
from tests.helpers.mobgap import TRIALS, recording


@cache
def analysis(*segments: Segment, name: str = "fast_with_turns") -> TakeAnalysis:
    return analyse(simulate_scenario(name, 1, worn=segments).recording)


def figures(a: TakeAnalysis) -> dict[str, Parameter]:
    return {p.name: p for p in a.parameters if p.side is None}


@pytest.mark.slow
def test_a_single_pelvis_sensor_gives_cadence_steps_bouts_and_turns() -> None:
    a = analysis("pelvis")
    assert a.problem is None
    result = figures(a)
    assert result["cadence_spm"].mean == pytest.approx(124.0, rel=0.02)
    assert result["step_time_s"].mean == pytest.approx(0.484, rel=0.02)
    assert result["step_count"].mean == pytest.approx(89, abs=3)
    assert result["walking_bout_count"].mean == 1
    assert result["walking_duration_min"].mean == pytest.approx(0.71, abs=0.03)
    assert result["turn_count"].mean == 3
    assert result["turn_angle_deg"].mean == pytest.approx(180.0, abs=5.0)
    assert a.angles is None
    assert a.calibration is None


@pytest.mark.recorded
def test_a_recording_of_a_lower_back_alone_needs_no_calibration() -> None:
    """mobgap_lowback: no manifest, no declared mounting, 12 s of a person."""
    a = analyse(recording(TRIALS[0]))
    assert a.problem is None
    assert figures(a)["cadence_spm"].mean == pytest.approx(99.4, rel=0.05)
    assert a.measured is not None
    assert len(a.measured.bouts) == 1


@pytest.mark.slow
def test_its_files_read_back_to_the_same_numbers() -> None:
    a = analysis("pelvis")
    files = analysis_files(a)
    assert len(files["steps.csv"].splitlines()) == 1 + len(a.measured.steps.steps)  # type: ignore[union-attr]
    bundle = load_bundle(files)
    assert bundle.parameters == a.parameters
    second_gait = measure_gait(read_tracks(files[NAME], bundle.events, bundle.angles))
    assert [(p.name, p.n, p.reason) for p in second_gait.parameters] == [
        (p.name, p.n, p.reason) for p in a.parameters
    ]
    # accelerations are kept in single precision
    for x, y in zip(second_gait.parameters, a.parameters, strict=True):
        assert (x.mean is None) == (y.mean is None)
        assert x.mean is None or x.mean == pytest.approx(y.mean, rel=1e-5)
    assert second_gait.bouts == a.measured.bouts  # type: ignore[union-attr]


@pytest.mark.slow
def test_thighs_and_pelvis_without_feet_keep_their_angles_and_get_steps() -> None:
    a = analysis("pelvis", "thigh_l", "thigh_r", name="comfortable")
    assert a.angles is not None
    assert figures(a)["step_count"].mean == pytest.approx(72, abs=3)


@pytest.mark.slow
def test_shanks_without_feet_give_strides_by_their_own_detectors_and_say_so() -> None:
    a = analysis("pelvis", "shank_l", "shank_r", name="comfortable")
    assert a.measured is not None
    assert a.measured.steps is None
    assert {e.source for e in a.measured.events.events} == {"consensus"}
    assert figures(a)["cadence_spm"].mean == pytest.approx(111.0, rel=0.01)
    assert "led_by_other" in {n.code for n in a.notices}


@pytest.mark.slow
def test_with_a_foot_sensor_the_foot_decides() -> None:
    a = analysis("pelvis", "foot_l", "foot_r", name="comfortable")
    assert a.measured is not None
    assert a.measured.steps is None
    assert "step_count" not in figures(a)
    assert figures(a)["walking_bout_count"].mean == len(a.measured.bouts) > 0
    assert all(b.from_rest for b in a.measured.bouts)
    assert all(b.initiation_s is not None and 0.2 < b.initiation_s < 1.5 for b in a.measured.bouts)


@pytest.mark.slow
def test_what_cannot_be_calibrated_leaves_the_steps_of_the_trunk_and_says_why() -> None:
    take = simulate_scenario("fast_with_turns", 1, worn=("pelvis", "foot_l", "foot_r")).recording
    streams = {
        d: replace(s, t_s=s.t_s[k] - 8.0, acc=s.acc[k], gyr=None if s.gyr is None else s.gyr[k], mag=None)
        for d, s in take.streams.items()
        for k in [(s.t_s >= 8.0) & (s.t_s < 28.0)]
    }
    never = PipelineConfig(calibration=CalibrationParams(from_walking=WalkRungParams(least_s=100.0)))
    a = analyse(replace(take, streams=streams), never)
    assert a.problem is None
    assert a.stopped_at is None
    assert figures(a)["cadence_spm"].mean == pytest.approx(124.0, rel=0.02)
    by_code = {n.code: n.severity for n in a.notices}
    assert by_code["trunk_alone"] == "warning"
    assert {"no_rest", "not_still"} & set(by_code)
    assert "error" not in by_code.values()
    walked = analyse(replace(take, streams=streams))
    assert walked.calibration is not None
    assert walked.calibration.posture == "walking"
    whole = analysis("pelvis", "foot_l", "foot_r")
    assert figures(walked)["cadence_spm"].mean == pytest.approx(figures(whole)["cadence_spm"].mean, rel=0.02)


@pytest.mark.slow
def test_sitting_with_a_trunk_sensor_says_that_nobody_walked() -> None:
    take = simulate_scenario("comfortable", 1, worn=("pelvis",)).recording
    (stream,) = take.streams.values()
    still = stream.t_s < 5.5
    short = replace(
        stream,
        t_s=stream.t_s[still],
        acc=stream.acc[still],
        gyr=None if stream.gyr is None else stream.gyr[still],
        mag=None,
    )
    a = analyse(replace(take, streams={stream.device_id: short}))
    assert "no_walking" in {n.code for n in a.notices}
    assert figures(a)["cadence_spm"].mean is None
    assert figures(a)["cadence_spm"].reason == "no_walking"
    assert figures(a)["walking_bout_count"].mean == 0
