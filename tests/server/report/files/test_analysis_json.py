"""Content of analysis.json."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from sagittal.core.body.health import HealthFinding
from sagittal.core.parameters.result import Parameter
from sagittal.core.pipeline import TakeAnalysis
from sagittal.server.report.files.analysis_json import parameter_row, summarise_analysis
from sagittal.server.report.words.wording import JUDGED, PATH_JUDGED
from tests.server import analysed


@pytest.fixture(scope="module")
def finished() -> TakeAnalysis:
    return analysed.analysis()


@pytest.fixture(scope="module")
def said(finished: TakeAnalysis) -> dict[str, Any]:
    return summarise_analysis(finished)


def test_it_is_plain_json_without_numbers_that_are_none(said: dict[str, Any]) -> None:
    assert json.loads(json.dumps(said, allow_nan=False))["schema"] == 1


def test_an_analysis_that_stopped_early_says_what_it_reached() -> None:
    analysis = summarise_analysis(analysed.analysis(reached=False))
    for name in ("calibration", "calibration_score", "estimator", "walking", "functional", "body"):
        assert analysis[name] is None, name
    assert (analysis["scores"], analysis["mean_curves"], analysis["parameters"]) == ([], {}, [])
    assert analysis["warnings"] != []


def test_angles_of_the_calibration_are_in_degrees_and_what_is_not_known_is_null(said: dict[str, Any]) -> None:
    foot = said["calibration"]["segments"]["foot_l"]
    assert foot["forward_sd_deg"] == pytest.approx(math.degrees(0.05))
    assert foot["gyro_bias_dps"] == [pytest.approx(math.degrees(0.01)), 0.0, None]
    assert foot["rest_norm_mps2"] == 9.8
    assert said["calibration"]["rest_s"] == [[0.0, 2.0]]


def test_mean_curves_have_101_points_in_degrees_with_the_decimals_of_single_precision(
    said: dict[str, Any],
) -> None:
    knee = said["mean_curves"]["left"]["knee_flexion"]
    assert len(knee) == 101
    assert 55.0 < max(knee) < 65.0
    assert all(round(x, 5) == x for x in knee)
    assert set(said["mean_curves"]) == {"left", "right"}


def test_scores_are_profiles_and_none_of_a_single_curve(said: dict[str, Any]) -> None:
    assert said["scores"]
    assert all("variable" not in s for s in said["scores"])


def test_the_path_of_walking_is_told_with_the_uncertainty_of_contacts(
    said: dict[str, Any], finished: TakeAnalysis
) -> None:
    measured = finished.measured
    assert measured is not None
    assert said["walking"]["contact_uncertainty_s"] == measured.events.contact_uncertainty_s
    assert [b["start_s"] for b in said["walking"]["bouts"]] == [b.start_s for b in measured.bouts]


@pytest.mark.parametrize(
    ("value", "name", "level", "reasons"),
    [
        (0.4, "joint_residual_mm", "good", []),
        (0.6, "joint_residual_mm", "usable", [JUDGED["warn"]]),
        (2.1, "joint_residual_mm", "poor", [JUDGED["bad"]]),
        (2.1, "longest_moving_s", "poor", [PATH_JUDGED]),
    ],
)
def test_the_level_is_the_worse_of_signals_and_estimator(
    finished: TakeAnalysis, value: float, name: str, level: str, reasons: list[str]
) -> None:
    assert finished.posed is not None
    assert finished.posed.poses is not None
    poses = replace(finished.posed.poses, health=(HealthFinding(name, None, value, 0.5, 2.0),))
    variant = replace(finished, posed=replace(finished.posed, poses=poses), angles=None, measured=None)
    fields: dict[str, Any] = summarise_analysis(variant)
    quality = fields["quality"]
    assert (quality["level"], quality["signals_level"], quality["reasons"]) == (level, "good", reasons)
    assert fields["estimator"]["health"][0]["value"] == value


def test_a_parameter_without_a_finite_number_is_null() -> None:
    row = parameter_row(
        Parameter("stride_time_s", "left", 1, 1.1, math.nan, "s", cv_pct=math.inf, u_own=0.01)
    )
    assert (row["mean"], row["sd"], row["cv_pct"], row["u_own"]) == (1.1, None, None, 0.01)
    assert (row["name"], row["side"], row["n"], row["unit"]) == ("stride_time_s", "left", 1, "s")
    assert set(row) == {
        "name", "side", "n", "mean", "sd", "unit", "reason", "cv_pct", "ci_low", "ci_high", "note",
        "uncertainty", "u_own", "u_common", "estimated",
    }  # fmt: skip
