"""A bad verdict of the estimator reaches people: in the level, and in angles that are withheld."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement.params import AgreementParams, ExchangeParams
from sagittal.core.angles import JointAngles
from sagittal.core.angles.withheld import withhold_distances
from sagittal.core.body.erkf.health import REFUSED_PCT
from sagittal.core.body.estimate import PoseEstimate
from sagittal.core.body.health import HealthFinding, find_worst_verdict
from sagittal.core.estimators import HINGES
from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import Segment
from sagittal.core.parameters.catalogue import list_curve_figures
from sagittal.core.parameters.kinematic import cycle_curves, summarise_angles
from sagittal.core.parameters.live.live_figures import StrideSpan, early_figures
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.parameters.spatial import GROUND, NAMES
from sagittal.core.parameters.temporal import per_stride, summarise_times
from sagittal.core.pipeline import PipelineConfig, TakeAnalysis, analyse
from sagittal.core.quality import find_shown_level
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import simulate_scenario
from sagittal.server.report.charts.curves import cycle_svg
from sagittal.server.report.charts.panels import curve_panels
from sagittal.server.report.files.bundle import load_bundle
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.files.tracks import read_tracks
from sagittal.server.report.tables import curves_csv
from sagittal.server.report.view.model import report_model
from sagittal.server.report.view.quality_box import quality_box
from sagittal.server.report.view.table import NOBODY
from sagittal.server.report.words.wording import REASONS
from tests.helpers.marks import sweep_after
from tests.helpers.walks import neura_recording


def worn(recording: Recording, segments: dict[Segment, Segment] | None = None, *only: Segment) -> Recording:
    """The same with segments renamed, and with some of them alone."""
    names = {d: None if s is None else (segments or {}).get(s, s) for d, s in recording.segments.items()}
    return replace(recording, segments={d: s if not only or s in only else None for d, s in names.items()})


@cache
def exchanged() -> TakeAnalysis:
    """A simulated walk, the sensors of both thighs taken for each other."""
    left_so = PipelineConfig(agreement=AgreementParams(exchange=ExchangeParams(repair=False)))
    return analyse(
        worn(simulate_scenario("comfortable", 0).recording, {"thigh_l": "thigh_r", "thigh_r": "thigh_l"}),
        left_so,
    )


@cache
def sparse() -> TakeAnalysis:
    """The same walk from pelvis and feet."""
    return analyse(worn(simulate_scenario("comfortable", 0).recording, None, "pelvis", "foot_l", "foot_r"))


@cache
def feet_alone() -> TakeAnalysis:
    """The same walk from the feet."""
    return analyse(worn(simulate_scenario("comfortable", 0).recording, None, "foot_l", "foot_r"))


def at_the_bound(result: TakeAnalysis) -> TakeAnalysis:
    """The same with legs too short for the way their feet go: knees rest at their bound through stance."""
    assert result.angles is not None
    assert result.tracks is not None
    ends = {name: bound + np.radians(12.0) for name, bound in result.angles.bounds.items()}
    assert len(ends) == 2
    held = {name: np.maximum(result.angles.angles[name], end) for name, end in ends.items()}
    angles = replace(result.angles, angles={**result.angles.angles, **held}, bounds=ends)
    tracks = replace(result.tracks, angles=angles)
    return replace(result, angles=angles, tracks=tracks, measured=measure_gait(tracks))


@pytest.mark.slow
def test_the_level_people_see_is_the_worst_of_signals_and_estimator() -> None:
    assert [find_shown_level(level, None) for level in ("good", "usable", "poor")] == [
        "good",
        "usable",
        "poor",
    ]
    assert find_shown_level("good", "bad") == "poor"
    assert find_shown_level("good", "warn") == "usable"
    assert find_shown_level("poor", "good") == "poor"
    exchange = exchanged()
    assert exchange.poses is not None
    assert (exchange.quality.level, find_worst_verdict(exchange.poses.health)) == ("usable", "bad")
    files = analysis_files(exchange)
    quality = json.loads(files["analysis.json"])["quality"]
    assert (quality["level"], quality["signals_level"]) == ("poor", "usable")
    assert "sensors contradict" in quality["reasons"][-1]
    box = quality_box(load_bundle(files))
    assert box.kind == "bad"


@pytest.mark.slow
def test_angles_of_a_joint_whose_estimator_is_bad_are_withheld_with_the_reason() -> None:
    exchange = exchanged()
    assert exchange.angles is not None
    hips_and_knees = {
        f"{joint}_{motion}_{side}"
        for joint, motions in (("hip", ("flexion", "adduction", "rotation")),
                               ("knee", ("flexion", "adduction", "rotation")))
        for motion in motions
        for side in "lr"
    }  # fmt: skip
    assert exchange.angles.withheld == dict.fromkeys(exchange.angles.withheld, "estimator_bad")
    assert set(exchange.angles.withheld) >= hips_and_knees
    assert not set(exchange.angles.withheld) & set(exchange.angles.angles)
    assert "angles_withheld" in [n.code for n in exchange.notices]
    knees = [p for p in exchange.parameters if p.name.startswith(("knee_", "hip_"))]
    assert len(knees) >= 16
    assert all((p.mean, p.sd, p.reason) == (None, None, "estimator_bad") for p in knees)
    # times are of the feet and stay
    assert all(p.mean is not None for p in exchange.parameters if p.name == "stride_time_s")


@pytest.mark.slow
def test_what_was_withheld_stays_so_in_files_pages_and_after_an_edit() -> None:
    exchange = exchanged()
    files = analysis_files(exchange)
    bundle = load_bundle(files)
    assert exchange.angles is not None
    assert bundle.angles is not None
    assert bundle.angles.withheld == exchange.angles.withheld
    header = files["strides.csv"].decode().splitlines()[0].split(",")
    rows = [line.split(",") for line in files["strides.csv"].decode().splitlines()[1:]]
    for name in list_curve_figures():
        if name.startswith(("knee_", "hip_")) and name in header:
            assert not any(row[header.index(name)] for row in rows), name
    second_gait = measure_gait(read_tracks(files["tracks.parquet"], bundle.events, bundle.angles))
    reference = {(p.name, p.side): p.reason for p in exchange.parameters}
    assert {(p.name, p.side): p.reason for p in second_gait.parameters} == reference
    curves = cycle_curves(bundle.angles, bundle.strides)
    panels = {p.variable.name: p for p in curve_panels(bundle, curves, NOBODY)}
    assert panels["knee_flexion"].reason == REASONS["estimator_bad"]


DISTANCES = ("gait_speed_mps", "total_distance_m", *NAMES[1:])


@pytest.mark.slow
def test_distances_of_a_chain_that_does_not_hang_together_are_withheld_in_files_and_after_an_edit() -> None:
    exchange = exchanged()
    distances = [p for p in exchange.parameters if p.name in DISTANCES]
    assert len(distances) == 2 + 2 * len(NAMES[1:])
    assert {(p.mean, p.reason) for p in distances} == {(None, "estimator_bad")}
    messages = [n.message for n in exchange.notices if n.code == "distances_withheld"]
    assert len(messages) == 1
    assert messages[0].startswith(
        "Distances of both feet are not reported: the path does not fit the sensors."
    )
    files = analysis_files(exchange)
    bundle = load_bundle(files)
    second_gait = measure_gait(read_tracks(files["tracks.parquet"], bundle.events, bundle.angles))
    assert {p.reason for p in second_gait.parameters if p.name in DISTANCES} == {"estimator_bad"}


@pytest.mark.slow
def test_distances_of_a_foot_that_refuses_its_own_rests_are_withheld_of_it_alone() -> None:
    results = sparse()
    assert results.poses is not None
    assert results.feet is not None
    assert results.orientations is not None
    assert not results.feet.withheld
    refused = HealthFinding("zero_velocity_refused_pct", "foot_l", 42.0, *REFUSED_PCT)
    assert refused.verdict == "bad"
    poses = replace(results.poses, health=(refused,))
    result = withhold_distances(PoseEstimate(results.orientations, poses, results.feet))
    assert result.feet is not None
    assert result.feet.withheld == {"left": "path_bad"}
    (notices,) = (n.message for n in result.poses.notices if n.code == "distances_withheld")
    assert "left foot are not reported: the path does not fit its rests on the floor" in notices
    assert "path" in REASONS["path_bad"]
    assert "sensors" not in REASONS["path_bad"]
    assert results.tracks is not None
    measured = measure_gait(replace(results.tracks, feet=result.feet))
    source = {(p.name, p.side): p for p in measured.parameters}
    assert source["stride_length_m", "left"].reason == "path_bad"
    assert source["stride_length_m", "right"].mean is not None
    assert source["gait_speed_mps", None].n == source["stride_length_m", "right"].n
    assert source["total_distance_m", None].n == 1


@pytest.mark.slow
def test_a_figure_that_rests_on_the_bound_of_the_leg_model_is_withheld() -> None:
    result = at_the_bound(sparse())
    assert result.measured is not None
    knees = {(p.name, p.side): p for p in result.parameters if p.name.startswith("knee_")}
    for side in ("left", "right"):
        p = knees["knee_flexion_min_stance_deg", side]
        assert (p.mean, p.sd, p.reason) == (None, None, "at_bound")
        peak = knees["knee_flexion_max_swing_deg", side]
        assert peak.mean is not None
        assert peak.mean > 45.0
    column = result.measured.columns["knee_flexion_min_stance_deg"]
    counted_strides = [v for v, s in zip(column, result.measured.strides.strides, strict=True) if not s.flags]
    assert len(counted_strides) > 10
    assert set(counted_strides) == {None}
    # no spread of zero is left anywhere
    assert all(p.sd is None or p.sd > 0.05 for p in knees.values())
    # nor in any point of a curve that the figures are read from
    bundle = load_bundle(analysis_files(result))
    report = report_model(bundle)
    rows = [line.split(",") for line in curves_csv(report).decode().splitlines()]
    mean, reason = rows[0].index("mean_deg"), rows[0].index("reason")
    written = [r for r in rows[1:] if r[0] == "knee_flexion"]
    assert {r[reason] for r in written if not r[mean]} == {"at_bound"}
    assert {r[reason] for r in written if r[mean]} == {""}
    for side, bound in (("left", "knee_flexion_l"), ("right", "knee_flexion_r")):
        notices = [float(r[mean]) for r in written if r[1] == side and r[mean]]
        assert min(notices) > np.degrees(result.angles.bounds[bound] if result.angles else np.nan) + 0.1
        visible_replay = report.replay["curves"]["knee_flexion"][side]  # type: ignore[index]
        assert [x is None for x in visible_replay] == [not r[mean] for r in written if r[1] == side]
        assert None in visible_replay
    assert any(note.startswith("Knee flexion: interrupted") for note in report.curve_notes)
    drawn = cycle_svg(report.key_curve)
    assert "nan" not in drawn
    assert drawn.split('class="ml" d="')[1].split('"')[0].count("M") > 1
    assert bundle.angles is not None
    assert bundle.angles.bounds == pytest.approx(result.angles.bounds if result.angles else {})


HINGED = {f"{v}_{side}" for v in HINGES for side in "lr"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("take", "fixed"), [(sparse, HINGED), (feet_alone, HINGED | {"pelvis_tilt", "pelvis_obliquity"})]
)
def test_what_the_leg_model_holds_fixed_is_no_result(
    take: Callable[[], TakeAnalysis], fixed: set[str]
) -> None:
    trial = take()
    assert trial.angles is not None
    assert {n for n, cause in trial.angles.withheld.items() if cause == "fixed_by_model"} == fixed
    assert not fixed & set(trial.angles.angles)
    # the others move
    assert all(np.nanstd(x) > np.radians(0.1) for x in trial.angles.angles.values())
    variables = {name.removesuffix("_l").removesuffix("_r") for name in fixed}
    assert trial.measured is not None
    curves = cycle_curves(trial.angles, trial.measured.strides)
    for variable in variables:
        assert curves.why[variable] == dict.fromkeys(("left", "right"), "fixed_by_model")
    assert "angles_withheld" not in [n.code for n in trial.notices]
    bundle = load_bundle(analysis_files(trial))
    report = report_model(bundle)
    panels = {p.variable.name: p for p in report.panels}
    assert {v for v, p in panels.items() if p.reason == REASONS["fixed_by_model"]} == variables
    written = {line.split(",")[0] for line in curves_csv(report).decode().splitlines()[1:]}
    assert not written & variables
    assert "knee_flexion" in written
    assert not fixed & set(report.zero_offset_deg)
    notes = " ".join(report.curve_notes)
    assert ("pelvic tilt" in notes) == (take is sparse)
    assert "Ankle, hip, knee angles of both sides are estimated" in notes
    # the figure keeps what it is drawn with
    assert trial.poses is not None
    assert {"shank_l", "thigh_l", "pelvis"} <= set(trial.poses.q)


@pytest.mark.slow
@pytest.mark.parametrize(
    "walk", sweep_after(2, ["neura", "comfortable", "hemiparetic", "stiff_knee", "crouch"])
)
def test_nothing_is_withheld_of_a_right_setup(walk: str) -> None:
    recording = neura_recording() if walk == "neura" else simulate_scenario(walk, 0).recording
    analysis = analyse(recording)
    assert analysis.angles is not None
    assert (analysis.angles.withheld, analysis.angles.bounds) == ({}, {})
    withheld = {"estimator_bad", "path_bad", "at_bound", "impossible"}
    assert not [p for p in analysis.parameters if p.reason in withheld]


def strides(step_s: float) -> Strides:
    """Strides of one second of both feet, the left contact `step_s` after the right one."""
    result = []
    for k in range(8):
        for side, shift, second in (("right", 0.0, step_s), ("left", step_s, 1.0)):
            start = k + shift
            result.append(
                Stride(side, start, start + 0.6, start + 1.0, start + 0.1, k + second)  # type: ignore[arg-type]
            )
    return Strides(tuple(result))


def test_a_step_that_nobody_can_take_is_not_told() -> None:
    result = {(p.name, p.side): p for p in summarise_times(strides(0.12))}
    short, long = result["step_time_s", "left"], result["step_time_s", "right"]
    values = {p.reason for p in (short, long)}
    assert "impossible" in values
    assert all(p.mean is None or p.mean >= 0.2 for p in (short, long))
    column = per_stride(strides(0.12))["step_time_s"]
    assert None in column
    assert all(v is None or v >= 0.2 for v in column)


@pytest.mark.parametrize("step_s", [0.02, 0.1, 0.19, 0.22, 0.24])
def test_a_cadence_that_nobody_can_walk_is_not_told(step_s: float) -> None:
    result = tuple(
        Stride(side, t, t + 1.2 * step_s, t + 2 * step_s, t + 0.1 * step_s, t + step_s)  # type: ignore[arg-type]
        for k in range(20)
        for side, t in (("right", 2 * k * step_s), ("left", (2 * k + 1) * step_s))
    )
    (cadence,) = (p for p in summarise_times(Strides(result)) if p.name == "cadence_spm")
    assert (cadence.mean, cadence.n, cadence.reason) == (None, 0, "impossible")


def bent(lowest_deg: float) -> JointAngles:
    """A right knee that goes from 60° to `lowest_deg` in every stride."""
    t = np.arange(0.0, 10.0, 0.01)
    middle, half = 0.5 * (60.0 + lowest_deg), 0.5 * (60.0 - lowest_deg)
    knee = np.radians(middle + half * np.cos(2.0 * np.pi * t))
    return JointAngles(t, {"knee_flexion_r": knee}, {"knee_flexion_r": 0.0})


def test_a_knee_that_no_knee_can_be_is_not_told() -> None:
    curves = cycle_curves(bent(-35.0), strides(0.5))
    knees = [p for p in summarise_angles(curves) if p.name.startswith("knee_") and p.side == "right"]
    assert all((p.mean, p.reason) == (None, "impossible") for p in knees)
    assert np.isnan(curves.curves["knee_flexion"]["right"]).all()
    notices = [
        p for p in summarise_angles(cycle_curves(bent(-15.0), strides(0.5))) if p.name.startswith("knee_")
    ]
    assert all(p.mean is not None for p in notices if p.side == "right")
    # who stands with the knee bent by 25° and was measured so may be 35° straighter
    crouched = replace(bent(-35.0), standing_deg={"knee_flexion_r": 25.0})
    reference = [
        p for p in summarise_angles(cycle_curves(crouched, strides(0.5))) if p.name.startswith("knee_")
    ]
    assert all(p.mean is not None for p in reference if p.side == "right")


def test_what_nobody_can_do_is_not_told_live_either() -> None:
    angles = bent(-35.0)
    quick = Stride("right", 2.0, 2.6, 3.0, 2.1, 2.9)
    result, curves = early_figures(quick, StrideSpan(angles.t_s, {}, {}, angles, None), GROUND)
    assert result["step_time_s"] == "impossible"
    assert result["knee_flexion_rom_deg"] == "impossible"
    assert "knee_flexion" not in curves
