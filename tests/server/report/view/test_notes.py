"""Notes accompanying tables and curves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sagittal.core.norms import Norms, look_up_norms
from sagittal.core.norms.controls import ControlGroup
from sagittal.server.report.charts.panels import CurvePanel, SideCurve
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.view.model import ReportModel, report_model
from sagittal.server.report.view.notes import curve_notes, norm_note
from sagittal.server.report.view.table import FEW_NOTE
from sagittal.server.report.words.wording import NO_NORM
from tests.server.report.conftest import MakeBundle


def controls(**changes: Any) -> ControlGroup:
    result = {"n": 12, "group": "own controls", "source": "this clinic", "values": {}, "bands": {}}
    return ControlGroup(**{**result, "reference": None, "reason": None, "note": None, **changes})


def shown(bundle: Bundle, **options: Any) -> ReportModel:
    return report_model(bundle, **options)


def panel(bundle: Bundle, **changes: Any) -> CurvePanel:
    item = next(p for p in shown(bundle).panels if p.reason is None and p.sides)
    return replace(item, **changes)


def test_without_a_norm_the_note_is_the_reason_and_each_reason_is_told_once() -> None:
    reason = "no_norm_for_age"
    assert norm_note([], [], Norms(None, None, reason=reason, timing_reason=reason)) == NO_NORM[reason]
    alternative = norm_note([], [], Norms(None, None, reason=reason, timing_reason="age_unknown"))
    assert alternative == f"{NO_NORM[reason]} {NO_NORM['age_unknown']}"


def test_own_controls_say_how_many_they_are() -> None:
    nobody = Norms(None, None)
    assert norm_note([], [], nobody, controls()) == (
        "Where no published norm is comparable: own controls, 12 people."
    )
    assert norm_note([], [], nobody, controls(note="small_group")).endswith("12 people, a small group.")
    few = controls(n=3, reason="few_controls")
    assert norm_note([], [], nobody, few) == "Own controls at the same speed: 3, too few for a comparison."
    assert norm_note([], [], nobody) == ""


def test_the_people_of_a_band_are_named_where_an_angle_is_compared(bundle: Bundle) -> None:
    norms = look_up_norms(40, "female", 1.25, 1.7, ())
    assert not norms.comfortable_bands
    band = next(iter(norms.bands.values()))
    drawn = panel(bundle, norm=replace(band, zero="anatomical"))
    message = norm_note([], [drawn], norms)
    assert message.startswith(f"Norm: {band.n} ")
    assert message.endswith(f"1.25 ± 0.16 m/s, mean ± 1 SD ({band.source}).")
    assert norm_note([], [panel(bundle, norm=replace(band, zero="standing"))], norms) == ""


def test_too_few_strides_are_told_once(bundle: Bundle) -> None:
    rows = [r for _, result in shown(bundle).groups for r in result][:3]
    few = [replace(r, norm_note=FEW_NOTE, norm=None) for r in rows]
    assert norm_note(few, [], Norms(None, None)) == FEW_NOTE


def notes(bundle: Bundle, *panels: CurvePanel) -> str:
    return "\n".join(curve_notes(bundle, panels))


def test_the_zero_of_curves_is_told_with_what_was_subtracted(bundle: Bundle) -> None:
    assert bundle.angles is not None
    offsets = {"knee_flexion_l": np.radians(4.6), "hip_adduction_l": 0.1, "ankle_dorsiflexion_x": 0.1}
    stood = replace(bundle, angles=replace(bundle.angles, zero_offset=offsets))
    message = notes(stood, panel(bundle, zero="standing"))
    assert "Subtracted: knee flexion left 5°. If the person" in message
    walked = notes(bundle, panel(bundle, zero="walking"))
    assert walked.startswith("No quiet standing in this trial")
    assert "Subtracted" not in walked
    assert notes(bundle, panel(bundle, zero="anatomical")).startswith("Curves from neutral use")


def test_a_zero_of_curves_that_are_not_there_is_not_told(bundle: Bundle) -> None:
    assert notes(bundle, panel(bundle, zero="standing", reason="joint_missing", norm_note="")) == ""
    assert curve_notes(replace(bundle, angles=None), [panel(bundle)]) == ()


def test_curves_with_a_gap_are_named(bundle: Bundle) -> None:
    whole = panel(bundle, zero=None)
    broken = {
        side: replace(c, mean_deg=np.where(np.arange(101) == 3, np.nan, 1.0))
        for side, c in whole.sides.items()
    }
    name = whole.variable.label.capitalize()
    assert f"{name}: interrupted where the knee of the leg model" in notes(
        bundle, replace(whole, sides=broken)
    )
    assert "interrupted" not in notes(bundle, whole)


def test_a_note_on_the_norm_names_all_the_variables_it_is_about(bundle: Bundle) -> None:
    first = panel(bundle, zero=None, norm_note="No norm band: so.")
    second = replace(first, variable=replace(first.variable, label="Toe angle"))
    third = replace(first, norm_note="", reason=None)
    label = first.variable.label.capitalize()
    assert notes(bundle, first, second, third) == f"{label}, toe angle: no norm band: so."


def test_what_is_drawn_of_many_strides_is_told(make_bundle: MakeBundle) -> None:
    bundle = make_bundle()
    curve = SideCurve(np.zeros(101), None, 2, {1: np.zeros(101), 2: np.zeros(101)}, None, None)
    drawn = panel(bundle, zero=None, norm_note="", sides={"left": curve})
    assert notes(bundle, drawn) == ""
    more = replace(drawn, sides={"left": replace(curve, n=3)})
    assert notes(bundle, more).startswith("Thin lines show 40 strides per side")
