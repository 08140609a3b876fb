from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import pytest

from sagittal.core.errors import Notice
from sagittal.core.events.result import GaitEvents, Strides
from sagittal.core.norms.lookup import look_up_norms
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.charts.panels import FEW_BAND
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.tables import curves_csv, parameters_csv
from sagittal.server.report.view.key_numbers import say_plus_minus
from sagittal.server.report.view.model import report_model
from sagittal.server.report.view.table import FEW_NOTE, ParameterRow, parameter_rows
from sagittal.server.report.words.wording import VARIABLES, difference_words, parameter_term, place_words
from tests.helpers.pairs import in_pairs, plain_python

MakeBundle = Callable[..., Bundle]


def row(rows: tuple[ParameterRow, ...], name: str) -> ParameterRow:
    return next(r for r in rows if r.name == name)


def rows_of(*parameters: Parameter) -> tuple[ParameterRow, ...]:
    return parameter_rows(parameters)


def of(name: str, side: str | None, mean: float | None, reason: str | None = None) -> Parameter:
    n, sd = (12, 0.001) if mean is not None else (0, None)
    return Parameter(name, side, n, mean, sd, "s", reason)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "left", "right", "words"),
    [
        ("stride_time_s", 1.21, 1.17, "left longer by 0.04\u202fs"),
        ("stride_time_s", 1.171, 1.169, "no difference"),
        ("stance_pct", 62.0, 70.5, "left shorter by 8.5 points"),
        ("knee_flexion_rom_deg", 60.6, 52.2, "left larger by 8°"),
        ("knee_flexion_ic_deg", -3.0, 4.0, "left straighter by 7°"),
        ("knee_flexion_ic_deg", 3.4, 3.0, "no difference"),
        ("foot_pitch_ic_deg", 25.0, 10.0, "left toes higher by 15°"),
    ],
)
def test_difference_is_said_in_words(name: str, left: float, right: float, words: str) -> None:
    assert difference_words(left, right, parameter_term(name)) == words


def test_words_agree_with_the_printed_numbers() -> None:
    result = row(
        rows_of(of("step_time_s", "left", 0.6851), of("step_time_s", "right", 0.7049)), "step_time_s"
    )
    assert result.left is not None
    assert result.right is not None
    assert (result.left.text, result.right.text) == ("0.69", "0.70")
    assert result.difference == "left shorter by 0.01\u202fs"


def test_what_the_strides_leave_open_is_no_difference() -> None:
    """Left 0.60 ± 0.08, right 0.64 ± 0.08 m of twelve: 95 % of the difference is −0.11 … 0.03 m."""
    sides = both("step_length_m", 0.60, 0.64)
    open_ = row(rows_of(*(replace(p, sd=0.08) for p in sides)), "step_length_m")
    assert (open_.difference, open_.symmetry_words) == ("no clear difference", "")
    assert open_.symmetry is not None
    assert not open_.symmetry.clear
    tiny = row(
        rows_of(*(replace(p, sd=0.003) for p in both("circumduction_m", 0.021, 0.022))), "circumduction_m"
    )
    assert tiny.difference == "no clear difference"
    steady = (replace(p, sd=0.0) for p in both("circumduction_m", 0.021, 0.024))
    assert row(rows_of(*steady), "circumduction_m").difference == "no clear difference", "known to 1 cm only"
    assert row(rows_of(*sides), "step_length_m").difference == "left shorter by 0.04\u202fm"


def test_three_strides_stand_with_their_number_and_are_compared_with_nothing() -> None:
    sides = both("step_length_m", 0.51, 0.60)
    norms = look_up_norms(40, "female", 1.2, 1.7)
    (full,) = parameter_rows(sides, norms)
    assert full.z_words
    assert full.left is not None
    assert full.left.few == ""
    (few,) = parameter_rows([replace(sides[0], n=3), replace(sides[1], n=1, sd=None)], norms)
    assert few.left is not None
    assert few.right is not None
    assert (few.left.text, few.left.few, few.right.few) == ("0.51", "3 strides", "1 stride")
    assert (few.left.z, few.right.z, few.z_words, few.symmetry) == (None, None, "", None)
    assert few.difference is None
    assert (few.norm, few.norm_mean, few.comfortable, few.norm_group) == (None, None, None, None)
    assert few.norm_note == FEW_NOTE
    assert 'class="band"' not in few.plot
    # a side of enough strides keeps its norm, and the other is not put over it
    (one,) = parameter_rows([sides[0], replace(sides[1], n=3)], norms)
    assert one.norm == full.norm
    assert (one.plot.count("<circle"), full.plot.count("<circle")) == (1, 2)


def test_a_take_of_few_strides_shows_no_norm_anywhere(bundle: Bundle) -> None:
    assert bundle.angles is not None
    names = [f"{name}_{side}" for name in ("knee_flexion", "hip_flexion") for side in "lr"]
    entered = replace(bundle.angles, standing_deg=dict.fromkeys(names, 4.0))
    retained: dict[str, int] = {"left": 0, "right": 0}
    strides = []
    for s in bundle.strides.strides:
        counts = s.excluded_reason is None and retained[s.side] < (3 if s.side == "left" else 2)
        retained[s.side] += counts
        strides.append(s if counts else replace(s, excluded_reason=s.excluded_reason or "turn"))
    few = replace(
        bundle,
        angles=entered,
        strides=Strides(tuple(strides)),
        parameters=tuple(replace(p, n=min(p.n, retained[p.side or "left"])) for p in bundle.parameters),
    )
    whole = report_model(replace(bundle, angles=entered), age=40, sex="male")
    model = report_model(few, age=40, sex="male")
    assert any(p.norm is not None for p in whole.panels)
    assert not any(p.norm is not None or p.comfortable is not None for p in model.panels)
    assert {p.norm_note for p in model.panels if p.variable.name == "knee_flexion"} == {FEW_BAND}
    assert any("norm" in k.words for k in whole.kpis)
    assert not any("norm" in k.words for k in model.kpis)
    assert FEW_NOTE in model.norm_note
    rows = list(csv.DictReader(io.StringIO(parameters_csv(model).decode())))
    counted_strides = [r for r in rows if r["side"] and r["mean"]]
    assert counted_strides
    assert {r["norm_mean"] for r in counted_strides} == {""}
    curves = csv.DictReader(io.StringIO(curves_csv(model).decode()))
    assert {r["norm_mean_deg"] for r in curves} == {""}


def test_a_large_number_says_what_each_side_is_known_to() -> None:
    left, right = both("knee_flexion_rom_deg", 70.0, 71.0, "deg")
    (rows,) = parameter_rows([replace(left, n=2, uncertainty=30.8), replace(right, n=1, sd=None)])
    assert say_plus_minus(rows) == "± 30.8 | –"
    (rows,) = parameter_rows([replace(left, uncertainty=4.0), replace(right, uncertainty=5.0)])
    assert say_plus_minus(rows) == "± 4.0 | 5.0"
    (rows,) = parameter_rows([left, right])
    assert say_plus_minus(rows) == ""


def test_no_number_is_known_to_nothing() -> None:
    (rows,) = parameter_rows(
        [Parameter("cadence_spm", None, 4000, 111.2, 1.9, "steps/min", uncertainty=0.08)]
    )
    assert rows.both is not None
    assert (rows.both.text, rows.both.plus_minus) == ("111", "± 0.1")


def test_a_missing_number_gives_its_reason_never_zero() -> None:
    pair = rows_of(
        of("stance_pct", "left", None, "no_terminal_contact"),
        of("stance_pct", "right", None, "no_terminal_contact"),
    )
    assert pair[0].reason == "not measured: no foot-off detected"
    assert pair[0].left is None
    one = rows_of(of("stance_pct", "left", 61.0), of("stance_pct", "right", None, "no_strides"))[0]
    assert one.reason is None
    assert one.right is None
    assert one.difference == "right not measured: no included stride on this side"


def test_a_side_withheld_beside_an_estimated_one_says_why() -> None:
    name = "knee_flexion_min_stance_deg"
    left = Parameter(name, "left", 9, 4.8, 5.6, "deg", estimated=True)
    right = Parameter(name, "right", 0, None, None, "deg", "at_bound", estimated=True)
    (rows,) = parameter_rows((left, right))
    assert rows.side_reason == "not reported: the knee of the leg model is at its limit"
    assert rows.difference == f"right {rows.side_reason}"
    assert (rows.low_confidence, rows.reason) == (True, None)


def test_the_csv_says_why_a_side_has_no_number_and_keeps_the_rows_of_the_whole_take(bundle: Bundle) -> None:
    rows = parameter_rows(
        (
            of("stance_pct", "left", 62.0),
            of("stance_pct", "right", None, "no_strides"),
            of("pci_pct", None, None, "few_strides"),
        )
    )
    model = replace(report_model(bundle, age=40, speed_mps=1.2), groups=(("", rows),))
    notices = [
        (r["name"], r["side"], r["mean"] == "", r["reason"] == "")
        for r in csv.DictReader(io.StringIO(parameters_csv(model).decode()))
    ]
    assert sorted(notices) == [
        ("pci_pct", "", True, False),
        ("stance_pct", "left", False, True),
        ("stance_pct", "right", True, False),
    ]


def test_an_unknown_parameter_is_shown_under_its_own_name() -> None:
    rows = rows_of(of("new_index", None, 3.0))[0]
    assert (rows.title, rows.group) == ("new_index", "Other")
    assert rows.both is not None


def test_box_counts_strides_and_names_the_worst_sensor(bundle: Bundle) -> None:
    box = report_model(bundle).quality
    items = {i.label: i for i in box.items}
    assert (box.kind, box.word) == ("ok", "Good data")
    strides = items["Strides included"]
    used = len(bundle.strides.select_used("left"))
    assert (strides.left, strides.left_of) == (used, used + 1)
    assert (items["Lost samples"].value, items["Lost samples"].extra) == ("0.3 %", "at most, right shank")
    assert (items["Calibration"].value, items["Calibration"].kind) == ("from standing and walking", None)
    assert items["Angle zero"].value == "standing"


def test_box_says_how_many_checks_of_the_calibration_fail(make_bundle: MakeBundle) -> None:
    verdicts = ("pass", "redo", "pass", "not_judged")
    score = {"checks": [{"verdict": v} for v in verdicts]}
    items = {i.label: i for i in report_model(make_bundle(calibration_score=score)).quality.items}
    notices = items["Calibration"]
    assert (notices.value, notices.kind, notices.page) == ("2 of 3 checks", "warn", "calibration")


@pytest.mark.parametrize(
    ("severity", "level", "kind"),
    [("warning", "good", "warn"), ("info", "good", "ok"), ("error", "good", "bad"), ("info", "poor", "bad")],
)
def test_verdict_follows_the_worst_notice(
    make_bundle: MakeBundle, severity: str, level: str, kind: str
) -> None:
    notice = Notice("gap", "0.3 s lost.", "pelvis", severity=severity)  # type: ignore[arg-type]
    model = report_model(make_bundle(warnings=(notice,), quality={"level": level}))
    assert model.quality.kind == kind
    assert model.warnings[0].title == "Gap, pelvis"
    assert (model.problem is not None) == (severity == "error")


def test_a_take_without_strides_keeps_every_panel_in_its_place(make_bundle: MakeBundle) -> None:
    model = report_model(make_bundle(strides=Strides(()), parameters=()))
    assert model.quality.kind == "bad"
    assert [p.variable for p in model.panels] == list(VARIABLES)
    assert all(p.reason is not None and p.norm is None for p in model.panels)
    assert model.used == {"left": 0, "right": 0}


def test_a_stopped_analysis_is_a_report_too(make_bundle: MakeBundle) -> None:
    stop = Notice("no_rest", "Nobody stood still.", severity="error")
    model = report_model(
        make_bundle(warnings=(stop,), angles=None, strides=Strides(()), parameters=(), calibration=None)
    )
    assert model.problem == "Nobody stood still."
    assert model.duration_s == 12.0
    json.dumps(model.to_json(), allow_nan=False)


def test_curves_say_their_zero_and_their_confidence(bundle: Bundle) -> None:
    panels = {p.variable.name: p for p in report_model(bundle, age=40).panels}
    assert panels["pelvis_tilt"].reason is None
    assert panels["pelvis_rotation"].title == "Pelvic rotation, from its mean over the stride"
    assert panels["hip_rotation"].low_confidence
    assert not panels["hip_flexion"].low_confidence
    assert panels["knee_flexion"].title == "Knee flexion, relative to standing"


def test_source_and_number_of_the_norm_are_printed_or_why_there_is_none(bundle: Bundle) -> None:
    adult = report_model(bundle, age=40, sex="female")
    assert "25 adults 21–54 years" in adult.norm_note
    assert "Fukuchi" in adult.norm_note
    assert "year of birth" in report_model(bundle).norm_note
    child = report_model(bundle, age=10, sex="female")
    assert child.norm_note.startswith("No norm for this age")
    assert all(p.norm is None for p in child.panels)
    assert "Timing: female, 10 years, normal pace (Lythgo2011)." in child.norm_note
    assert all(r.norm is None for _, rows in child.groups for r in rows if r.unit == "°")
    assert report_model(bundle, age=40, speed_mps=0.2).norm_note.startswith("No norm at this speed")


def test_slow_walking_keeps_the_norm_of_speed_itself(bundle: Bundle) -> None:
    speed = Parameter("gait_speed_mps", None, 20, 0.2, 0.05, "m/s")
    remaining = tuple(p for p in bundle.parameters if p.name != speed.name)
    model = report_model(replace(bundle, parameters=(speed, *remaining)), age=40, sex="female")
    assert model.norm_note.startswith("No norm at this speed")
    assert "Gait speed: adults 21–84 years (Fukuchi" in model.norm_note
    rows = {r.name: r for _, group in model.groups for r in group}
    assert rows["gait_speed_mps"].both is not None
    assert rows["gait_speed_mps"].both.z == pytest.approx(-6.6, abs=0.05)
    assert {r.name for r in rows.values() if r.norm is not None} == {"gait_speed_mps"}


def test_a_slow_walker_is_held_against_people_at_this_speed_and_the_comfortable_ones_stand_beside(
    bundle: Bundle,
) -> None:
    model = report_model(bundle, age=40, sex="female", speed_mps=0.5)
    assert "healthy adults asked to walk at this speed (0.50" in model.norm_note
    rows = {r.name: r for _, group in model.groups for r in group}
    row = rows["step_length_m"]
    assert row.norm_group == "healthy adults asked to walk at this speed"
    assert row.norm_mean == pytest.approx(0.472, abs=0.002)
    assert model.profile is not None
    assert model.profile.at_speed
    assert all(bar.comfortable_left and bar.comfortable_right for bar in model.profile.rows)
    usual = report_model(bundle, age=40, sex="female", speed_mps=1.3)
    assert not usual.at_speed
    assert usual.profile is not None
    assert not any(bar.comfortable_left for bar in usual.profile.rows)


def test_offsets_that_were_subtracted_are_printed(bundle: Bundle) -> None:
    assert "hip flexion left 6°" in report_model(bundle).curve_notes[0]


def test_json_has_no_nan_and_the_same_means_as_the_stored_parameters(bundle: Bundle) -> None:
    data = json.loads(json.dumps(report_model(bundle, age=40, sex="male").to_json(), allow_nan=False))
    stored = {(p.name, p.side): p.mean for p in bundle.parameters}
    for r in data["parameters"]:
        for side in ("left", "right"):
            if r[side] is not None:
                assert r[side]["value"] == stored[r["name"], side]
    knee = next(c for c in data["curves"] if c["variable"] == "knee_flexion")
    assert len(knee["sides"]["left"]["mean_deg"]) == 101


def test_replay_data_is_what_the_clock_needs(bundle: Bundle) -> None:
    replay = json.loads(json.dumps(report_model(bundle).replay, allow_nan=False))
    assert replay["duration_s"] == pytest.approx(11.99)
    assert len(replay["strides"]) == len(bundle.strides.strides)
    assert set(replay["curves"]["knee_flexion"]) == {"left", "right"}


def test_sides_are_compared_in_numbers_and_words() -> None:
    result = row(rows_of(*both("step_length_m", 0.39, 0.25)), "step_length_m")
    assert result.symmetry is not None
    assert result.symmetry.index_pct == pytest.approx(43.75)
    assert result.symmetry_words == (
        "left / right 1.56, symmetry index +43.8 % (positive: left larger), "
        "symmetry angle −13.7 % (negative: left larger)"
    )
    near = row(rows_of(*both("circumduction_m", 0.14, 0.03)), "circumduction_m")
    assert near.symmetry_words == "a side is too near zero for a ratio"
    angle = row(rows_of(*both("knee_flexion_ic_deg", 8.0, 2.0, "deg")), "knee_flexion_ic_deg")
    assert (angle.symmetry_words, angle.difference) == ("", "left more flexed by 6°")


def both(name: str, left: float, right: float, unit: str = "m") -> tuple[Parameter, Parameter]:
    return Parameter(name, "left", 12, left, 0.01, unit), Parameter(name, "right", 12, right, 0.01, unit)


def test_tables_have_a_csv_twin(bundle: Bundle) -> None:
    model = report_model(bundle, age=40, sex="male")
    parameters = list(csv.DictReader(io.StringIO(parameters_csv(model).decode())))
    stance = [r for r in parameters if r["name"] == "stance_pct"]
    assert [r["side"] for r in stance] == ["left", "right"]
    assert float(stance[0]["mean"]) == pytest.approx(62.0, abs=0.1)
    assert float(stance[0]["ratio_left_right"]) == pytest.approx(
        float(stance[0]["mean"]) / float(stance[1]["mean"])
    )
    assert bundle.angles is not None
    entered = replace(bundle.angles, standing_deg={"knee_flexion_l": 4.0, "knee_flexion_r": 3.0})
    model = report_model(replace(bundle, angles=entered), age=40, sex="male")
    curves = list(csv.DictReader(io.StringIO(curves_csv(model).decode())))
    knee = [r for r in curves if r["variable"] == "knee_flexion" and r["side"] == "right"]
    assert len(knee) == 101
    assert knee[0]["norm_sd_deg"] != ""
    assert not any(value in ("nan", "None") for r in curves for value in r.values())


def test_segments_are_said_in_words() -> None:
    assert [place_words(s) for s in ("shank_r", "pelvis", "00B40C44")] == [
        "right shank",
        "pelvis",
        "00B40C44",
    ]


@pytest.mark.bench
def test_ten_minutes_are_reported_in_little_more_than_a_piece_of_plain_python(
    make_bundle: MakeBundle,
) -> None:
    long = make_bundle(600.0)
    report_model(long, age=40, sex="male")
    _, _, ratio = in_pairs(lambda: report_model(long, age=40, sex="male"), plain_python)
    sys.stdout.write(f"report of ten minutes: {ratio:.2f} pieces of plain Python\n")
    assert ratio < 4.0


@pytest.mark.slow
def test_reading_a_result_does_not_load_the_compiler() -> None:
    modules = "sagittal.server.report.tables, sagittal.server.report.view.model"
    code = f"import sys, {modules}; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_shares_of_the_stride_have_their_place_where_the_contacts_are_exact(make_bundle: MakeBundle) -> None:
    exact = make_bundle()
    coarse = make_bundle(
        events=GaitEvents(tuple(replace(e, uncertainty_s=0.06) for e in exact.events.events))
    )
    for bundle, placed in ((exact, True), (coarse, False)):
        rows = tuple(r for _, rows in report_model(bundle, age=72, sex="female").groups for r in rows)
        for name in ("stance_pct", "swing_pct", "double_support_pct"):
            result = row(rows, name)
            assert (result.norm is not None) == placed
            assert bool(result.z_words) == placed
            assert placed or "too uncertain" in result.norm_note
        assert row(rows, "stride_time_s").norm is not None
