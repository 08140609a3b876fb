"""Titles are unique per angle; norms are drawn only for curves with the same zero."""

from __future__ import annotations

import csv
import io
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.frames import SIDES, SUFFIX
from sagittal.core.norms.controls import ControlSession, control_group, mean_curves
from sagittal.core.norms.kinematics import adult_kinematics
from sagittal.core.parameters import cycle_curves
from sagittal.core.parameters.kinematic import MEAN_ZERO
from sagittal.core.subject.standing_angles import NAMES, PELVIS
from sagittal.server.report.charts.panels import CurvePanel, same_zero
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.tables import curves_csv, parameters_csv
from sagittal.server.report.view.model import ReportModel, report_model
from tests.server.report.conftest import MakeBundle
from tests.server.report.words.test_estimator import section

STANDING = {
    f"{joint}_{s}": angle for joint, angle in (("hip_flexion", 12.0), ("knee_flexion", 6.0)) for s in "lr"
}


def measured(bundle: Bundle, standing: dict[str, float]) -> ReportModel:
    assert bundle.angles is not None
    return report_model(replace(bundle, angles=replace(bundle.angles, standing_deg=standing)), age=40)


def panel(model: ReportModel, variable: str) -> CurvePanel:
    return next(p for p in model.panels if p.variable.name == variable)


@settings(deadline=None, max_examples=12)
@given(st.dictionaries(st.sampled_from(NAMES), st.floats(-40.0, 40.0)))
@pytest.mark.slow
def test_a_curve_has_a_norm_band_of_its_own_zero_or_none(
    make_bundle: MakeBundle, standing: dict[str, float]
) -> None:
    bundle = make_bundle()
    plain, model = report_model(bundle, age=40), measured(bundle, standing)
    for initial, p in zip(plain.panels, model.panels, strict=True):
        assert initial.norm is None, "what starts from standing has no anatomical band"
        assert p.norm is None or p.norm.zero == p.zero
        name = p.variable.name
        entered = [name] if name in PELVIS else [f"{name}_{SUFFIX[s]}" for s in SIDES]
        level = name not in MEAN_ZERO and all(n in standing for n in entered)
        assert p.zero == ("stride_mean" if name in MEAN_ZERO else "anatomical" if level else "standing")
        if p.reason is None and level and name in adult_kinematics(40).bands:
            assert p.norm is not None
        for side, curve in p.sides.items():
            at_zero = initial.sides[side]
            assert curve.mean_deg is not None
            assert at_zero.mean_deg is not None
            sign = -1.0 if name == "pelvis_obliquity" and side == "left" else 1.0
            moved = sign * standing[entered[0 if name in PELVIS else SIDES.index(side)]] if level else 0.0
            assert curve.mean_deg == pytest.approx(at_zero.mean_deg + moved)
            for i, row in curve.strides.items():
                assert row == pytest.approx(at_zero.strides[i] + moved)


def test_the_figure_at_contact_is_where_its_curve_begins(bundle: Bundle) -> None:
    model = measured(bundle, STANDING)
    rows = {r.name: r for _, group in model.groups for r in group}
    hip, row = panel(model, "hip_flexion"), rows["hip_flexion_ic_anatomical_deg"]
    for side, cell in (("left", row.left), ("right", row.right)):
        curve = hip.sides[side].mean_deg  # type: ignore[index]
        assert curve is not None
        assert cell is not None
        assert curve[0] == pytest.approx(cell.value)
    assert hip.title == "Hip flexion, anatomical"
    assert row.title == "Hip flexion at contact, anatomical"
    assert rows["hip_flexion_ic_deg"].title == "Hip flexion at contact, relative to standing"
    assert rows["hip_flexion_rom_deg"].title == "Hip flexion range"


@pytest.mark.parametrize("standing", [{}, STANDING, {"knee_flexion_l": 5.0}])
def test_no_title_and_no_name_occurs_twice_in_a_report(bundle: Bundle, standing: dict[str, float]) -> None:
    model = measured(bundle, standing)
    notices = model.to_json()
    rows, curves = notices["parameters"], notices["curves"]
    assert isinstance(rows, list)
    assert isinstance(curves, list)
    for result in ([r["title"] for r in rows], [r["name"] for r in rows], [c["title"] for c in curves]):
        assert max(Counter(result).values()) == 1
    lines = list(csv.DictReader(io.StringIO(parameters_csv(model).decode())))
    assert max(Counter((r["name"], r["side"]) for r in lines).values()) == 1
    zeros = {c["variable"]: c["zero"] for c in curves}
    for r in csv.DictReader(io.StringIO(curves_csv(model).decode())):
        assert r["zero"] == zeros[r["variable"]]
        assert (r["norm_mean_deg"] != "") == (panel(model, r["variable"]).norm is not None)


def test_why_there_is_no_band_is_said_once(bundle: Bundle) -> None:
    notes = " ".join(report_model(bundle, age=40).curve_notes)
    assert notes.count("no norm band: these curves are relative to this person's standing") == 1
    partly = " ".join(measured(bundle, STANDING).curve_notes)
    assert "Curves from neutral use the goniometer angles" in partly
    assert "no norm band" in partly


def test_own_controls_from_standing_give_curves_from_standing_their_band(bundle: Bundle) -> None:
    assert bundle.angles is not None
    retained = mean_curves(cycle_curves(bundle.angles, bundle.strides))
    people = [ControlSession(f"c{i}", 40.0, "female", bundle.parameters, retained) for i in range(5)]
    model = report_model(bundle, age=40, controls=control_group(people))
    for p in model.panels:
        assert p.reason is not None or (p.norm is not None and p.norm.zero == p.zero), p.variable.name
    rows = {r.name: r for _, group in model.groups for r in group}
    level = rows["hip_flexion_ic_deg"]
    assert level.norm_source is not None
    assert "controls of this clinic" in level.norm_source
    assert "WBDS" in str(rows["hip_flexion_rom_deg"].norm_source), "a published norm goes first"


def test_an_estimated_angle_stays_from_standing_without_a_band(make_bundle: MakeBundle) -> None:
    bundle = make_bundle(estimator=section(estimated_angles=["knee_flexion_l", "knee_flexion_r"]))
    knee = panel(measured(bundle, STANDING), "knee_flexion")
    assert (knee.zero, knee.norm, knee.title) == ("standing", None, "Knee flexion, relative to standing")


def test_two_visits_are_drawn_from_one_zero(bundle: Bundle) -> None:
    plain, known_measurement = report_model(bundle, age=40), measured(bundle, STANDING)
    for initial, final in zip(plain.panels, known_measurement.panels, strict=True):
        one, two = same_zero(initial, final)
        assert one.zero == two.zero
        assert two.norm is None
        for side in two.sides:
            assert two.sides[side].mean_deg == pytest.approx(one.sides[side].mean_deg)
    hip = panel(known_measurement, "hip_flexion")
    assert same_zero(hip, hip) == (hip, hip)
    assert hip.norm is not None
