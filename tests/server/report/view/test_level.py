"""Goniometer angles make a second table, never a second meaning of the first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sagittal.core.change import parameter_changes
from sagittal.core.frames import SIDES
from sagittal.core.norms import Norms, look_up_norms
from sagittal.core.parameters import cycle_curves
from sagittal.core.parameters.anatomical_zero import anatomical_variables
from sagittal.core.parameters.result import CycleCurves, Parameter
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.history.comparison import add_changes
from sagittal.server.report.view.level import GROUP, level_rows
from sagittal.server.report.view.model import report_model
from tests.server import walk


def curves() -> CycleCurves:
    return cycle_curves(walk.angles(), walk.strides())


def norms(standing: dict[str, float]) -> Norms:
    return look_up_norms(40, "female", 1.2, 1.7, anatomical_variables(standing))


def test_levels_are_placed_among_healthy_people() -> None:
    standing = {"knee_flexion_l": 4.0, "knee_flexion_r": 4.0}
    plain = {r.name: r for r in level_rows(curves(), dict.fromkeys(standing, 0.0), norms(standing))}
    rows = {r.name: r for r in level_rows(curves(), standing, norms(standing))}
    assert set(rows) == {
        "knee_flexion_ic_anatomical_deg", "knee_flexion_max_loading_anatomical_deg",
        "knee_flexion_min_stance_anatomical_deg", "knee_flexion_max_swing_anatomical_deg",
    }  # fmt: skip
    swing, initial = (
        rows["knee_flexion_max_swing_anatomical_deg"],
        plain["knee_flexion_max_swing_anatomical_deg"],
    )
    assert swing.group == GROUP
    assert swing.left is not None
    assert initial.left is not None
    assert swing.left.value == pytest.approx(initial.left.value + 4.0)
    assert swing.norm_source is not None
    assert swing.left.z is not None
    assert swing.left.z == pytest.approx((swing.left.value - 61.08) / 3.83, abs=0.01)


def test_one_side_entered_has_its_value_and_no_norm() -> None:
    standing = {"hip_flexion_l": 4.0}
    (row,) = (
        r for r in level_rows(curves(), standing, norms(standing)) if r.name.startswith("hip_flexion_min")
    )
    assert row.left is not None
    assert (row.right, row.norm, row.left.z) == (None, None, None)


def test_nothing_entered_or_only_estimated_gives_no_table() -> None:
    assert level_rows(curves(), {}, norms({})) == ()
    standing = {"knee_flexion_l": 4.0, "knee_flexion_r": 4.0}
    assert level_rows(curves(), standing, norms(standing), ("knee_flexion",)) == ()


def test_the_report_shows_the_table_where_something_was_entered(bundle: Bundle) -> None:
    assert GROUP not in dict(report_model(bundle, age=40).groups)
    assert bundle.angles is not None
    entered = replace(bundle.angles, standing_deg={"knee_flexion_l": 4.0, "knee_flexion_r": 3.0})
    groups = dict(report_model(replace(bundle, angles=entered), age=40).groups)
    assert len(groups[GROUP]) == 4
    initial = {r.name: r for rows in groups.values() for r in rows}["knee_flexion_max_swing_deg"]
    assert initial.norm is None, "from standing it stays what it was"


def test_a_level_shows_the_change_from_standing_and_says_so() -> None:
    standing = {"knee_flexion_l": 4.0, "knee_flexion_r": 4.0}
    groups = ((GROUP, level_rows(curves(), standing, norms(standing))),)
    initial_parameters = [Parameter("knee_flexion_max_swing_deg", s, 30, 40.0, 1.0, "deg") for s in SIDES]
    now = [replace(p, mean=51.7) for p in initial_parameters]
    rows = {
        r.name: r
        for _, result in add_changes(groups, parameter_changes(initial_parameters, now))
        for r in result
    }
    change = rows["knee_flexion_max_swing_anatomical_deg"].change
    assert [(w.side, w.size, w.about) for w in change] == [
        ("left", "+11.7", "relative to standing"), ("right", "+11.7", "relative to standing")
    ]  # fmt: skip
    assert rows["knee_flexion_ic_anatomical_deg"].change == ()
