"""A take of squats, whole chain: depth, times and valgus of every repetition, no strides."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.parameters.symmetry import compare_sides
from sagittal.core.pipeline import SQUAT, PipelineConfig, TakeAnalysis, analyse, resume
from sagittal.core.pipeline.recipes import choose_recipe
from sagittal.core.pipeline.squat_stages import AGREED, NO_HEIGHT
from sagittal.core.signals.recording import Subject, UniformRecording
from sagittal.core.simulate import SquatSimulation, simulate_movement
from sagittal.core.squat.measures import MEASURES
from sagittal.core.squat.params import SquatParams
from sagittal.core.squat.side import find_squat_sides
from sagittal.core.timeline import synchronise
from sagittal.server.report.files.bundle import load_bundle
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.view.model import report_model
from tests.core.body.chain.squats import squat_on
from tests.core.calibration.test_table_top import RATE
from tests.helpers.table_top import from_table
from tests.helpers.walks import assert_same_figures


@cache
def made(name: str = "squats_agreed") -> SquatSimulation:
    simulation = simulate_movement(name, 1)
    assert isinstance(simulation, SquatSimulation)
    return simulation


@cache
def analysis(name: str = "squats_agreed") -> TakeAnalysis:
    return analyse(made(name).recording)


def test_the_protocol_decides_the_recipe_and_the_squats_are_the_true_ones() -> None:
    a = analysis()
    assert a.problem is None
    assert choose_recipe(a) == SQUAT
    assert a.notices == (AGREED,)
    by_name = {p.name: p for p in a.parameters}
    depths = np.degrees(made().truth.depths_rad)
    assert {p.side for p in a.parameters} == {"right"}
    assert by_name["squat_depth_deg"].n == len(depths) == 6
    assert by_name["squat_depth_deg"].mean == pytest.approx(depths.mean(), abs=3.0)
    assert a.strides is None


def test_the_files_give_the_report_back() -> None:
    files = analysis_files(analysis())
    assert set(files) == {
        "analysis.json",
        "angles.parquet",
        "poses.parquet",
        "repetitions.csv",
        "signals.parquet",
    }
    rows = list(csv.DictReader(io.StringIO(files["repetitions.csv"].decode())))
    assert len(rows) == 6
    assert all(50.0 < float(row["squat_depth_deg"]) < 90.0 and not row["excluded_reason"] for row in rows)
    report = report_model(load_bundle(files))
    assert [name for name, _ in report.groups] == ["Squats"]
    assert report.quality.word == "Good data"
    assert ("Squats included", "6", "right leg") in [
        (i.label, i.value, i.extra) for i in report.quality.items
    ]
    assert report.problem is None


def test_a_height_that_nobody_gave_is_told() -> None:
    recording = replace(made().recording, subject=Subject())
    a = analyse(recording)
    assert a.notices == (AGREED, NO_HEIGHT)
    by_angle = {p.name: p.mean for p in a.parameters}
    known_by_name = {p.name: p.mean for p in analysis().parameters}
    assert by_angle["squat_depth_deg"] == pytest.approx(known_by_name["squat_depth_deg"], abs=0.5)


def test_sensors_that_sit_anyhow_stop_it() -> None:
    a = analysis("squats")
    assert a.problem is not None
    assert (a.problem.code, a.stopped_at) == ("mounting_not_as_agreed", "calibration")
    assert a.parameters == ()
    assert "repetitions.csv" not in analysis_files(a)


def test_an_analysis_goes_on_from_any_stage() -> None:
    whole = analysis()
    for stage in ("poses", "angles", "parameters"):
        second_resumed_run = resume(whole, stage)
        assert_same_figures(second_resumed_run.parameters, whole.parameters)
    strict = replace(
        PipelineConfig().squat, repetitions=replace(PipelineConfig().squat.repetitions, least_rad=2.0)
    )
    none = resume(whole, "calibration", replace(PipelineConfig(), squat=strict))
    assert {p.reason for p in none.parameters} == {"no_repetitions"}
    assert report_model(load_bundle(analysis_files(none))).quality.word == "No squats"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["squats_both_legs", "squats_together"])
def test_both_legs_of_a_take_are_measured_and_compared(name: str) -> None:
    a, truth = analysis(name), made(name).truth
    assert a.problem is None
    assert a.legs is not None
    assert a.squats is not None
    assert a.angles is not None
    result = {(p.name, p.side): p for p in a.parameters}
    depths = np.degrees(truth.depths_rad)
    source = {"right": depths, "left": depths}
    if name == "squats_both_legs":
        source = {"right": depths[:5], "left": depths[5:]}
    for side, true in source.items():
        depth = result["squat_depth_deg", side]  # type: ignore[index]
        assert depth.n == len(true)
        assert depth.mean == pytest.approx(true.mean(), abs=2.0)
        end = side[0]
        index = [r.bottom for leg in a.squats if leg.side == side for r in leg.repetitions if not r.excluded]
        standing = truth.subtract_standing()
        for joint, most in (("knee_flexion", 2.0), ("hip_flexion", 2.0), ("hip_rotation", 4.0)):
            off = a.angles.angles[f"{joint}_{end}"][index] - standing[f"{joint}_{end}"][index]
            assert np.degrees(np.abs(off)).max() < most, joint
    compared = {s.name: s for s in compare_sides(a.parameters)}
    assert set(compared) == set(MEASURES)
    rows = list(csv.DictReader(io.StringIO(analysis_files(a)["repetitions.csv"].decode())))
    lifted = [r["side"] for r in rows if r["excluded_reason"] == "foot_lifted"]
    assert sorted(lifted) == (["left", "right"] if name == "squats_both_legs" else [])
    assert [float(r["start_s"]) for r in rows] == sorted(float(r["start_s"]) for r in rows)


@pytest.mark.slow
def test_a_lifted_foot_has_no_ankle_and_its_knee_is_followed() -> None:
    a, truth = analysis("squats_both_legs"), made("squats_both_legs").truth
    assert a.angles is not None
    height = truth.p["foot_l"][: len(a.angles.t_s), 2]
    lifted = height > height[0] + 0.09
    assert np.isnan(a.angles.angles["ankle_dorsiflexion_l"][lifted]).all()
    off = a.angles.angles["knee_flexion_l"] - truth.subtract_standing()["knee_flexion_l"][: len(lifted)]
    assert np.degrees(np.abs(off[lifted])).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["squats_agreed", "squats_both_legs", "squats_together"])
def test_the_figure_stands_on_its_feet(name: str) -> None:
    a, truth = analysis(name), made(name).truth
    poses = a.poses
    assert poses is not None
    assert set(poses.q) == set(truth.q)
    assert poses.valid.mean() > 0.99
    n, body = len(poses.t_s), poses.body
    for segment in truth.p:
        true = truth.p[segment][:n] - truth.p["pelvis"][:n]
        drawn = poses.p[segment] - poses.p["pelvis"]
        assert np.linalg.norm(drawn - true, axis=1).max() < 0.06, segment
    for foot, stood in poses.contact.items():
        still = truth.p[foot][:n, 2] < truth.p[foot][0, 2] + 0.005
        assert stood[still].mean() > 0.99
        assert np.ptp(poses.p[foot][still], axis=0).max() < 0.05, "a standing foot stays where it is"
        assert abs(poses.p[foot][still, 2].mean() - body.ankle_height) < 0.02


def test_what_legs_need_is_said() -> None:
    uniform = synchronise(made("squats_both_legs").recording)
    assert find_squat_sides(uniform) == ("left", "right")
    mapping = dict(uniform.sensors)
    del mapping["thigh_l"]
    assert find_squat_sides(replace(uniform, sensors=mapping)) == ("right",)
    del mapping["pelvis"]
    assert refusal(replace(uniform, sensors=mapping)) == "segments_missing"


def refusal(recording: UniformRecording) -> str:
    from sagittal.core.errors import EstimationError

    with pytest.raises(EstimationError) as caught:
        find_squat_sides(recording)
    return caught.value.code


def test_a_take_that_begins_on_the_table_calibrates_itself() -> None:
    config = PipelineConfig(squat=SquatParams(mounting="table_top"))
    a = analyse(from_table(), config)
    assert a.problem is None, a.problem
    assert a.calibration is not None
    assert a.calibration.method == "table_top"
    depth = next(p for p in a.parameters if p.name == "squat_depth_deg")
    truth = np.degrees(squat_on("right", RATE, repetitions=2).truth.depths_rad)
    assert depth.n == 2
    assert depth.mean == pytest.approx(truth.mean(), abs=3.0)
    assert "mounting_agreed" not in [n.code for n in a.notices]


def test_a_take_that_does_not_begin_on_the_table_is_refused() -> None:
    a = analyse(made().recording, PipelineConfig(squat=SquatParams(mounting="table_top")))
    assert a.problem is not None
    assert a.problem.code == "body_not_still"
    with pytest.raises(ParameterError) as caught:
        SquatParams(mounting="by_hand")  # type: ignore[arg-type]
    assert caught.value.code == "unknown_mounting"
