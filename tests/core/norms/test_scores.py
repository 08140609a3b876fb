"""Scores of a session: right numbers from right zeros, or none and why."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Bools, Floats, Side
from sagittal.core.norms import adult_reference
from sagittal.core.norms.profile import NINE, SAGITTAL
from sagittal.core.norms.scores import Scores, score_curves
from sagittal.core.parameters.kinematic import MEAN_ZERO
from sagittal.core.parameters.result import CycleCurves
from sagittal.core.subject.standing_angles import NAMES
from tests.helpers.wbds import people


def session(curves: Mapping[str, Mapping[Side, Floats]], strides: int = 12) -> CycleCurves:
    """A session whose strides are all alike; curves in degrees."""
    return CycleCurves(
        {
            v: {s: np.radians(np.tile(c, (strides, 1))) for s, c in sides.items()}
            for v, sides in curves.items()
        },
        {s: tuple(range(strides)) for s in SIDES},
        {s: np.ones(strides, np.bool_) for s in SIDES},
        {s: np.full(strides, 62.0) for s in SIDES},
    )


def norm(offset: float = 0.0, variables: tuple[str, ...] = NINE) -> CycleCurves:
    reference = adult_reference().mean_deg
    return session({v: dict.fromkeys(SIDES, reference[v] + offset) for v in variables})


def standing(angle: float, variables: tuple[str, ...] = SAGITTAL) -> dict[str, float]:
    return {f"{v}_{s}": angle for v in variables for s in "lr"}


def value(result: Scores, name: str, mode: str, side: Side | None = None) -> float | None:
    return result.find(name, mode, side).value  # type: ignore[arg-type]


def test_the_norm_scores_zero() -> None:
    scores = score_curves(norm(), standing(0.0))
    for side in (*SIDES, None):
        assert value(scores, "gps_sagittal_deg", "raw", side) == pytest.approx(0.0, abs=1e-9)
        assert value(scores, "gps_deg", "offset_removed", side) == pytest.approx(0.0, abs=1e-9)


def test_three_strides_have_no_score() -> None:
    reference = adult_reference().mean_deg
    curves = session({v: dict.fromkeys(SIDES, reference[v] + 1.0) for v in NINE}, 3)
    assert {s.value for s in score_curves(curves, dict.fromkeys(NAMES, 0.0)).scores} == {None}
    assert score_curves(curves).find("gps_deg", "offset_removed", "left").reason == "too_few_strides"


def test_without_goniometer_angles_there_is_no_raw_score_and_the_shape_scores_stay() -> None:
    scores = score_curves(norm(offset=8.0))
    assert value(scores, "gps_sagittal_deg", "offset_removed") == pytest.approx(0.0, abs=1e-9)
    for side in (*SIDES, None):
        raw = scores.find("gps_sagittal_deg", "raw", side)
        assert (raw.value, raw.reason, raw.n) == (None, "angle_zero_standing", 0)
        assert raw.missing == SAGITTAL
    raw_scores = [s for s in scores.scores if s.mode == "raw"]
    assert all(s.value is None and s.reason for s in raw_scores)
    assert scores.find("gps_deg", "raw").reason == "variables_missing"


def test_goniometer_angles_give_the_level_back() -> None:
    """Standing with everything bent by 10°: relative to standing, each curve is 10° too low."""
    scores = score_curves(norm(offset=-10.0), standing(10.0))
    assert value(scores, "gps_sagittal_deg", "raw") == pytest.approx(0.0, abs=1e-9)
    wrong = score_curves(norm(offset=-10.0), standing(0.0))
    assert value(wrong, "gps_sagittal_deg", "raw") == pytest.approx(10.0)
    one_side = score_curves(norm(), {"knee_flexion_l": 0.0})
    assert one_side.find("gvs_deg", "raw", "left", "knee_flexion").value == pytest.approx(0.0, abs=1e-9)
    assert one_side.find("gvs_deg", "raw", "right", "knee_flexion").reason == "angle_zero_standing"


def test_three_joints_are_never_called_gps() -> None:
    scores = score_curves(norm(variables=SAGITTAL), standing(0.0))
    full = scores.find("gps_deg", "raw")
    assert (full.value, full.reason) == (None, "joint_missing")
    assert "pelvis_rotation" in full.missing
    assert scores.find("gdi_star", "raw").value is None
    assert scores.find("gps_sagittal_deg", "raw").value is not None
    assert scores.find("gvs_deg", "raw", "left", "foot_progression").reason == "joint_missing"
    assert scores.find("gvs_deg", "raw", "left", "hip_adduction").reason == "joint_missing"


def test_rotation_and_progression_have_a_shape_and_no_level() -> None:
    """Goniometers do not give the walking direction: no raw nine-variable GPS, with a reason."""
    scores = score_curves(norm(), dict.fromkeys(NAMES, 0.0))
    for variable in MEAN_ZERO:
        assert scores.find("gvs_deg", "raw", "left", variable).reason == "no_level"
        assert scores.find("gvs_deg", "offset_removed", "left", variable).value == pytest.approx(
            0.0, abs=1e-9
        )
    full = scores.find("gps_deg", "raw")
    assert (full.value, full.reason, full.missing) == (None, "no_level", MEAN_ZERO)
    assert scores.find("gps_deg", "offset_removed").value == pytest.approx(0.0, abs=1e-9)


def test_pelvic_obliquity_entered_once_counts_up_on_one_side_and_down_on_the_other() -> None:
    reference = adult_reference().mean_deg["pelvis_obliquity"]
    # the right side 3° up while standing: zeroed there, it shows 3° too little, the left 3° too much
    curves = session({"pelvis_obliquity": {"left": reference + 3.0, "right": reference - 3.0}})
    scores = score_curves(curves, {"pelvis_obliquity": 3.0})
    for side in SIDES:
        one = scores.find("gvs_deg", "raw", side, "pelvis_obliquity")
        assert one.value == pytest.approx(0.0, abs=1e-9)


@pytest.mark.recorded
def test_healthy_people_have_an_index_of_one_hundred_in_the_middle() -> None:
    """Mean 100 and sd 10 leave one out; with the person in the reference about 42/41 closer to it."""
    scores = [score_curves(session({v: {s: p[s][v] for s in SIDES} for v in NINE}, 4)) for p in people()]
    spread = adult_reference().spreads["offset_removed"]["gps_overall"]
    assert spread.sd_ln is not None
    indices = np.array([value(f, "gdi_star", "offset_removed") for f in scores], np.float64)
    assert indices.mean() == pytest.approx(100.0 + 10.0 * np.log(42 / 41) / spread.sd_ln, abs=0.2)
    assert indices.std(ddof=1) == pytest.approx(10.0, abs=0.1)
    sides = [value(f, "gps_deg", "offset_removed", s) for f in scores for s in SIDES]
    assert np.mean(np.array(sides, np.float64)) == pytest.approx(2.35 * 41 / 42, abs=0.02)


def test_an_index_of_ninety_is_one_standard_deviation_of_the_logarithm() -> None:
    healthy = adult_reference().spreads["raw"]["gps_sagittal_overall"]
    assert healthy.mean_ln is not None
    assert healthy.sd_ln is not None
    far = score_curves(norm(offset=float(np.exp(healthy.mean_ln + healthy.sd_ln))), standing(0.0))
    assert value(far, "gdi_star_sagittal", "raw") == pytest.approx(90.0)
    assert far.find("gps_sagittal_deg", "raw").percentile == pytest.approx(84.13, abs=0.01)
    middle = score_curves(norm(offset=float(np.exp(healthy.mean_ln))), standing(0.0))
    assert value(middle, "gdi_star_sagittal", "raw") == pytest.approx(100.0)


def test_the_very_curves_of_the_norm_have_no_index() -> None:
    score = score_curves(norm(), standing(0.0)).find("gdi_star_sagittal", "raw")
    assert (score.value, score.percentile, score.reason) == (None, None, "score_zero")


def test_angles_that_no_two_sensors_measure_are_not_scored() -> None:
    scores = score_curves(norm(), standing(0.0), estimated=("knee_flexion",))
    assert scores.find("gvs_deg", "offset_removed", "left", "knee_flexion").reason == "estimated"
    assert value(scores, "gps_sagittal_deg", "offset_removed") is None


def test_excluded_strides_do_not_count() -> None:
    curves = norm()
    spoiled = {v: {s: rows.copy() for s, rows in sides.items()} for v, sides in curves.curves.items()}
    spoiled["knee_flexion"]["left"][3] += 1.0
    used: dict[Side, Bools] = {"left": np.arange(12) != 3, "right": np.ones(12, np.bool_)}
    scores = score_curves(CycleCurves(spoiled, curves.stride_index, used, curves.foot_off_pct), standing(0.0))
    left = scores.find("gvs_deg", "raw", "left", "knee_flexion")
    assert left.value == pytest.approx(0.0, abs=1e-9)
    assert left.n == 11
    assert scores.find("gps_sagittal_deg", "raw").n == 11


def test_children_are_not_scored_against_adults() -> None:
    child = score_curves(norm(offset=5.0), standing(0.0), age=9)
    assert {(s.value, s.percentile, s.reason) for s in child.scores} == {(None, None, "no_norm_for_age")}
    assert value(score_curves(norm(offset=5.0), standing(0.0), age=18), "gps_sagittal_deg", "raw") is not None
    own = adult_reference()
    assert value(score_curves(norm(), standing(0.0), own, age=9), "gps_sagittal_deg", "raw") is not None


def test_a_session_without_strides_says_so() -> None:
    empty = norm()
    none = {s: np.zeros(12, np.bool_) for s in SIDES}
    scores = score_curves(CycleCurves(empty.curves, empty.stride_index, none, empty.foot_off_pct))
    assert {s.reason for s in scores.scores} == {"no_strides"}


def test_scores_flags_changes_and_norms_need_no_compiler() -> None:
    """The web process imports them: numba would cost it seconds and memory."""
    code = "import sys; from sagittal.core import change, flags\n"
    code += "from sagittal.core.norms import controls, scores\n"

    code += "sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
