"""Values against limits as a page shows them, and the norm's place of a number."""

from __future__ import annotations

from sagittal.core.flags import RULES
from sagittal.core.norms.lookup import look_up_norms
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.view.model import report_model
from sagittal.server.report.view.table import parameter_rows
from sagittal.server.report.words.limits import NAMES
from tests.server.report.conftest import MakeBundle
from tests.server.report.words.test_estimator import section


def test_every_rule_has_words_that_name_no_disease() -> None:
    assert {rule.name for rule in RULES} == set(NAMES)
    assert not any(word in name.lower() for name in NAMES.values() for word in ("spastic", "paresis", "drop"))


def test_each_limit_stands_with_its_source(make_bundle: MakeBundle) -> None:
    limits = report_model(make_bundle()).limits
    assert limits is not None
    rows = (*limits.beyond, *limits.within)
    assert rows
    assert all(row.source and row.limit[0] in "≤≥" for row in rows)
    assert all(row.kind in ("warn", "bad") for row in limits.beyond)


def test_what_cannot_be_said_says_why(make_bundle: MakeBundle) -> None:
    limits = report_model(make_bundle()).limits
    assert limits is not None
    notes = {row.name: row.note for row in limits.unknown}
    assert "goniometer" in notes["Minimum knee flexion in stance"]
    assert notes["Circumduction"] == "no sensor on this foot"


def test_estimated_angles_are_held_against_nothing(make_bundle: MakeBundle) -> None:
    bundle = make_bundle(estimator=section(estimated_angles=["knee_flexion_l", "knee_flexion_r"]))
    limits = report_model(bundle).limits
    assert limits is not None
    names = {row.name for row in (*limits.beyond, *limits.within)}
    assert not any("knee" in name.lower() for name in names)


def test_without_counted_strides_there_are_none(make_bundle: MakeBundle) -> None:
    from sagittal.core.events.result import Strides

    assert report_model(make_bundle(strides=Strides(()))).limits is None


def test_a_number_says_its_interval_its_variation_and_its_place_in_the_norm() -> None:
    p = Parameter("knee_flexion_rom_deg", "left", 12, 50.0, 2.0, "deg", None, 4.0, 48.7, 51.3, "few_strides")
    (row,) = parameter_rows([p], look_up_norms(40, "female", 1.25, 1.7))
    assert row.left is not None
    assert row.left.z is not None
    assert row.left.z < -2.0
    for words in ("95 % CI 48.7 to 51.3", "CV 4.0 % of few strides", "percentile"):
        assert words in row.left.title
    assert row.z_words.startswith("z −")
    assert row.comfortable is None
    (slow,) = parameter_rows([p], look_up_norms(40, "female", 0.5, 1.7))
    assert slow.left is not None
    assert slow.left.z is not None
    assert -1.5 < slow.left.z < -1.2, "much of it is slowness"
    assert (slow.norm_group, slow.comfortable) == ("healthy adults asked to walk at this speed", row.norm)
    (none,) = parameter_rows([p], look_up_norms(40, "female", 0.2, 1.7))
    assert none.left is not None
    assert (none.left.z, none.z_words, none.norm) == (None, "", None)
