"""The movement analysis profile as a page shows it."""

from __future__ import annotations

from sagittal.server.report.history.numbers import numbers_of
from sagittal.server.report.history.trends import collect_figures
from sagittal.server.report.view.model import report_model
from sagittal.server.report.view.profile import TOTALS, profile_view
from sagittal.server.report.words.change_words import find_term
from sagittal.web.language import load_catalogue
from tests.server.report.conftest import MakeBundle
from tests.server.report.words.test_estimator import section


def test_every_scored_curve_has_a_bar_and_the_profile_comes_last(make_bundle: MakeBundle) -> None:
    profile = report_model(make_bundle()).profile
    assert profile is not None
    titles = [row.title for row in profile.rows]
    assert titles[-1] == "Sagittal profile score, levels removed"
    assert not any("_" in title for _, _, title in TOTALS)
    assert "Knee flexion" in titles
    assert "Pelvic rotation" not in titles, "not measured against the walking direction"
    assert [row.total for row in profile.rows].count(True) == 1
    knee = profile.rows[titles.index("Knee flexion")]
    assert float(knee.left) > 0.0
    assert not knee.low_confidence
    assert profile.rows[titles.index("Hip adduction")].low_confidence
    assert 'class="dl"' in knee.svg
    assert 'class="dr"' in knee.svg


def test_what_it_leaves_out_and_compares_with_is_said(make_bundle: MakeBundle) -> None:
    profile = report_model(make_bundle()).profile
    assert profile is not None
    assert "GPS not available" in profile.note
    german = load_catalogue("de").translate(profile.note)
    assert "Es gibt keinen GPS: Beckenrotation, Fußstellung zur Gehrichtung (nicht gemessen: " in german
    assert "42 healthy adults" in profile.note
    assert profile.index.startswith("GDI*, sagittal: left ")


def test_estimated_angles_are_not_scored(make_bundle: MakeBundle) -> None:
    bundle = make_bundle(estimator=section(estimated_angles=["knee_flexion_l", "knee_flexion_r"]))
    profile = report_model(bundle).profile
    assert profile is not None
    assert "Knee flexion" not in [row.title for row in profile.rows]
    assert not any("profile score" in row.title for row in profile.rows)


def test_the_score_is_that_of_patient_page_and_trends(make_bundle: MakeBundle) -> None:
    bundle = make_bundle()
    followed = {p.side: p.mean for p in collect_figures(numbers_of(bundle)) if p.name == "gps_sagittal_deg"}
    profile = report_model(bundle, age=40, speed_mps=0.6, height_m=1.75).profile
    assert profile is not None
    assert profile.score is not None
    assert profile.score_at_speed is not None
    assert profile.at_speed
    assert dict(profile.score.values) == followed
    assert profile.score.title == find_term("gps_sagittal_deg").label
    assert profile.score_at_speed.values != profile.score.values


def test_without_angles_there_is_none(make_bundle: MakeBundle) -> None:
    assert report_model(make_bundle(angles=None)).profile is None
    from sagittal.core.norms.scores import Scores

    assert profile_view(Scores((), 42, "", "", "")) is None
