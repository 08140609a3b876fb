"""The squats of a take in words and curves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.angles import JointAngles
from sagittal.core.frames import Floats, Side
from sagittal.core.squat.curves import VALGUS
from sagittal.core.squat.repetitions import FOOT_LIFTED
from sagittal.server.report.files.bundle import Bundle, StoredRepetition
from sagittal.server.report.view.squat import SURE, SquatSpan, SquatView, squat_view

VALUES = {
    "squat_depth_deg": 91.4,
    "squat_knee_valgus_deg": -4.6,
    "squat_hip_drop_m": 0.348,
    "squat_duration_s": 2.46,
}


def squat(side: Side, start_s: float, excluded: str | None = None) -> StoredRepetition:
    return StoredRepetition(side, start_s, start_s + 2.0, {} if excluded else VALUES, excluded)


def angles(**changes: Floats) -> JointAngles:
    """The left leg bends by 10° in its first squat from 0 s on, by 20° in its second from 2 s on."""
    t = np.arange(0.0, 6.0, 0.01)
    knee = np.radians(np.where(t < 2.0, 10.0, 20.0))
    out = {"knee_flexion_l": knee, "hip_adduction_l": 0 * t} | changes
    return JointAngles(t, out, dict.fromkeys(out, 0.1))


def view(bundle: Bundle, *result: StoredRepetition, moved: JointAngles | None = None) -> SquatView:
    visible_rows = squat_view(replace(bundle, repetitions=result, angles=moved))
    assert visible_rows is not None
    return visible_rows


def test_a_take_without_squats_has_none(bundle: Bundle) -> None:
    assert squat_view(bundle) is None
    assert squat_view(replace(bundle, repetitions=())) is None
    assert squat_view(replace(bundle, repetitions=(squat("left", 0.0, FOOT_LIFTED),))) is None


def test_squats_are_numbered_by_leg_and_told_in_words(bundle: Bundle) -> None:
    result = view(bundle, squat("left", 0.0), squat("right", 2.0), squat("left", 4.0, "foot_moved"))
    assert [(r.number, r.side) for r in result.rows] == [(1, "left"), (1, "right"), (2, "left")]
    first, _, moved = result.rows
    assert (first.start, first.depth, first.valgus, first.drop, first.duration) == (
        "0.0", "91", "−5", "0.35", "2.5"
    )  # fmt: skip
    assert first.excluded is None
    assert (moved.depth, moved.drop, moved.excluded) == ("–", "–", "the foot moved")
    assert result.used == {"left": 1, "right": 1}
    assert (result.sides, result.title) == (("left", "right"), "both legs")
    assert result.spans[2] == SquatSpan("left", 4.0, 6.0, False)


def test_bends_with_the_foot_off_the_floor_are_no_squats_and_are_told(bundle: Bundle) -> None:
    result = view(
        bundle,
        squat("left", 0.0),
        squat("right", 1.0, FOOT_LIFTED),
        squat("left", 2.0, FOOT_LIFTED),
        squat("right", 3.0, FOOT_LIFTED),
    )
    assert len(result.rows) == 1
    assert result.title == "left leg"
    assert result.not_listed == (
        "Knee flexion with the foot off the floor is not counted as a squat: 1 of the left knee and 2 "
        "of the right knee."
    )
    assert result.to_json()["bends_with_lifted_foot"] == {"left": 1, "right": 2}
    assert view(bundle, squat("left", 0.0)).not_listed == ""


def test_curves_are_means_of_the_squats_that_count_and_say_where_the_level_is_unsure(bundle: Bundle) -> None:
    result = view(
        bundle, squat("left", 0.0), squat("left", 2.0), squat("left", 4.0, "foot_moved"), moved=angles()
    )
    assert result.means_deg["knee_flexion"]["left"][50] == pytest.approx(15.0)
    assert [(c["title"], c["low"]) for c in result.charts] == [
        ("Knee flexion", False),
        ("Hip adduction", True),
    ]
    assert all(c["reason"] is None and str(c["svg"]).startswith("<div") for c in result.charts)
    assert set(SURE) & {VALGUS, "hip_adduction", "hip_rotation"} == set()


def test_an_angle_that_is_not_known_throughout_any_squat_has_no_curve_but_a_reason(bundle: Bundle) -> None:
    lost = angles(hip_adduction_l=np.where(angles().t_s % 2.0 < 0.5, np.nan, 0.0))
    result = view(bundle, squat("left", 0.0), moved=lost)
    assert [c["reason"] for c in result.charts] == [None, "not available throughout any squat"]
    assert result.means_deg["hip_adduction"] == {}


def test_without_angles_or_a_squat_that_counts_nothing_is_drawn(bundle: Bundle) -> None:
    assert view(bundle, squat("left", 0.0)).charts == ()
    assert view(bundle, squat("left", 0.0, "incomplete"), moved=angles()).charts == ()
