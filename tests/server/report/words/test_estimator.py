"""What pages and prints say about the pose estimator."""

from __future__ import annotations

from typing import Any

import pytest

from sagittal.core.estimators import ESTIMATORS, NO_FIGURE, PoseEstimator
from sagittal.server.report.view.model import report_model
from sagittal.server.report.words.estimator import (
    QUANTITIES,
    choice_label,
    estimator_view,
    list_estimated_angles,
    method_label,
)
from tests.server.report.conftest import MakeBundle


def finding(name: str, source: str | None, value: float | None, verdict: str = "good") -> dict[str, Any]:
    return {"name": name, "of": source, "value": value, "warn": 25.0, "bad": 80.0, "verdict": verdict}


def section(**changes: Any) -> dict[str, Any]:
    fields: dict[str, Any] = {
        "name": "erkf_smoothed",
        "requested": "auto",
        "reduced": None,
        "sensors": ["pelvis", "thigh_r", "shank_r", "foot_r"],
        "possible": ["erkf", "l7s_2i", "stance_foot_anchor"],
        "verdict": "good",
        "health": [
            finding("joint_residual_mm", "pelvis-thigh_r", 12.2),
            finding("joint_residual_mm", "thigh_r-shank_r", 19.4),
            {**finding("heading_sd_deg", None, 3.0), "warn": None, "bad": None},
            finding("min_eigenvalue", None, 1e-9),
        ],
        "feet": None,
        "estimated_angles": [],
        "diagnostics": {},
    }
    return fields | changes


def test_it_is_named_with_its_sensors_and_verdict() -> None:
    view = estimator_view(section())
    assert view is not None
    assert (view.name, view.sensors, view.kind, view.verdict) == ("ErKF, smoothed", 4, "ok", "consistent")
    assert view.reduced is None
    assert estimator_view(None) is None


def test_of_each_quantity_the_worst_is_shown_with_its_place_and_limit() -> None:
    view = estimator_view(section())
    assert view is not None
    first, second = view.health
    assert (first.label, first.text, first.limit) == ("Joint separation", "19\u202fmm", "≤ 25\u202fmm")
    assert first.where == "right thigh and right shank"
    assert (second.label, second.limit) == ("Heading uncertainty", "")


def test_what_could_not_be_measured_is_worse_than_any_value() -> None:
    health = [finding("gap_s", "foot_l", 0.2), finding("gap_s", "foot_r", None, "bad")]
    view = estimator_view(section(health=health, verdict="bad"))
    assert view is not None
    assert (view.kind, view.health[0].text, view.health[0].kind) == ("bad", "not measured", "bad")


def test_the_choice_offers_what_the_sensors_allow_and_marks_what_ran() -> None:
    view = estimator_view(section())
    assert view is not None
    assert [v for v, _, _ in view.choices] == ["auto", "erkf", "l7s_2i", "stance_foot_anchor"]
    assert [v for v, _, on in view.choices if on] == ["auto"]
    requests = estimator_view(section(name="l7s_2i", requested="l7s_2i"))
    assert requests is not None
    assert [v for v, _, on in requests.choices if on] == ["l7s_2i"]


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: e.name)
def test_it_has_the_paper_of_the_method_that_ran(estimator: PoseEstimator) -> None:
    view = estimator_view(section(name=estimator.method))
    assert view is not None
    assert view.paper == estimator.paper


def test_a_method_of_another_version_has_no_paper() -> None:
    view = estimator_view(section(name="of_tomorrow"))
    assert view is not None
    assert view.paper is None


def test_every_estimator_and_quantity_of_the_core_has_words() -> None:
    assert {choice_label(e.name) for e in ESTIMATORS} == {e.choice for e in ESTIMATORS}
    assert {method_label(e.method) for e in ESTIMATORS} == {e.label for e in ESTIMATORS}
    assert method_label(NO_FIGURE) == "No figure"
    assert (method_label("of_next_year"), choice_label("of_next_year")) == ("of_next_year", "of_next_year")
    assert {"joint_residual_mm", "climb_pct", "forward_axis_turned_deg", "hinge_mm"} <= set(QUANTITIES)


def test_angles_of_the_model_are_marked_on_their_curves(make_bundle: MakeBundle) -> None:
    bundle = make_bundle(estimator=section(estimated_angles=["knee_flexion_l", "knee_flexion_r"]))
    assert list_estimated_angles(bundle.estimator) == {"knee_flexion_l", "knee_flexion_r"}
    model = report_model(bundle)
    low = {p.variable.name: p.low_confidence for p in model.panels}
    assert low["knee_flexion"]
    assert not low["hip_flexion"]
    assert any("estimated by the leg model" in note for note in model.curve_notes)
    rows = {r.name: r for _, group in model.groups for r in group}
    assert rows["knee_flexion_rom_deg"].low_confidence
    assert not rows["hip_flexion_rom_deg"].low_confidence
    assert "knee_flexion_rom_deg" not in {k.name for k in model.kpis}


def test_an_angle_of_the_model_has_no_norm(make_bundle: MakeBundle) -> None:
    measured = report_model(make_bundle(estimator=section()), age=40, speed_mps=1.2)
    guessed = report_model(
        make_bundle(estimator=section(estimated_angles=["knee_flexion_l", "knee_flexion_r"])),
        age=40,
        speed_mps=1.2,
    )
    norms = [
        {r.name: r.norm for _, group in m.groups for r in group}["knee_flexion_rom_deg"]
        for m in (measured, guessed)
    ]
    assert norms[0] is not None
    assert norms[1] is None


def test_a_reduced_take_is_said_in_the_quality_box(make_bundle: MakeBundle) -> None:
    model = report_model(make_bundle(estimator=section(reduced="sensor_failed")))
    (item,) = (i for i in model.quality.items if i.label == "Pose estimator")
    assert (item.kind, item.extra) == ("warn", "reduced: a sensor failed in this trial")


def test_the_side_that_sensors_measure_keeps_its_own_confidence(make_bundle: MakeBundle) -> None:
    models = [
        report_model(make_bundle(estimator=section(estimated_angles=angles)), age=40, speed_mps=1.2)
        for angles in ([], ["knee_flexion_r"])
    ]
    whole, half = ({r.name: r for _, g in m.groups for r in g}["knee_flexion_rom_deg"] for m in models)
    assert (half.low_confidence, half.low_side) == (True, "right")
    assert half.left == whole.left
    assert half.norm == whole.norm
    assert half.right is not None
    assert half.right.z is None
