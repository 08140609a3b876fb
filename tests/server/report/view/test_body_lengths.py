"""The lengths that an analysis used, as the calibration page shows them."""

from __future__ import annotations

from dataclasses import asdict

from sagittal.core.body.model import LENGTHS, BodyModel
from sagittal.core.subject.anthropometry import BodyMeasures
from sagittal.server.report.view.body_lengths import BY_PELVIS, view_lengths


def told(height_m: float | None, measures: BodyMeasures) -> dict[str, tuple[str, bool, str]]:
    body = BodyModel.from_height(height_m or 1.7, measures)
    lengths = {name: {"m": asdict(body)[name], "measured": name in body.measured} for name in LENGTHS}
    rows = view_lengths({"height_m": height_m, "leg_m": measures.leg_m, "lengths": lengths})
    return {row.title.split(",")[0]: (row.value, row.measured, row.source) for row in rows}


def test_estimates_say_what_they_rest_on() -> None:
    rows = told(1.8, BodyMeasures())
    assert rows["Body height"] == ("1.80 m", True, "as entered")
    assert rows["Thigh"] == ("0.441 m", False, "Winter 2009, from body height")


def test_a_measured_leg_and_pelvis_are_named() -> None:
    rows = told(None, BodyMeasures(leg_m=0.9, pelvis_width_m=0.24, foot_m=0.25))
    assert "Body height" not in rows
    assert rows["Leg"] == ("0.900 m", True, "by tape measure")
    assert rows["Shank"] == ("0.418 m", False, "Winter 2009, from leg length")
    assert rows["Foot"] == ("0.250 m", True, "by tape measure")
    assert rows["Between the hip centres"] == ("0.173 m", True, BY_PELVIS)


def test_a_height_that_nobody_gave_is_assumed_and_nothing_is_shown_without_a_body() -> None:
    assert told(None, BodyMeasures())["Body height"] == ("1.70 m", False, "none entered")
    assert view_lengths(None) == ()
