"""Real change, measurement error, clinical relevance: each verdict from limits with a source."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.change import (
    Change,
    estimate_repeatability,
    parameter_changes,
    ratio_changes,
    score_changes,
    score_name,
)
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms import NormValue
from sagittal.core.norms.scores import Score
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.symmetry import compare_sides
from sagittal.core.parameters.variability import summarise_values


def parameter(name: str, mean: float | None, side: Side | None = None, unit: str = "deg") -> Parameter:
    return Parameter(name, side, 20, mean, 1.0, unit, None if mean is not None else "no_strides")


def one(
    name: str, earlier: float | None, later: float | None, side: Side | None = None, **more: object
) -> Change:
    unit = "m/s" if name.endswith("_mps") else "deg" if name.endswith("_deg") else "m"
    pair = parameter(name, earlier, side, unit), parameter(name, later, side, unit)
    (change,) = parameter_changes([pair[0]], [pair[1]], **more)  # type: ignore[arg-type]
    return change


@pytest.mark.parametrize("few", ["before", "after"])
def test_three_strides_are_no_change_whatever_they_measure(few: str) -> None:
    strides = {"before": 20, "after": 20, few: 3}
    old, new = (
        replace(parameter("knee_flexion_rom_deg", v, "left"), n=strides[k])
        for k, v in (("before", 40.0), ("after", 60.0))
    )
    (result,) = parameter_changes([old], [new])
    assert (result.verdict, result.limit, result.reason) == (None, None, "too_few_strides")
    assert (result.before, result.after, result.difference) == (40.0, 60.0, 20.0)


@pytest.mark.parametrize("guessed", ["before", "after"])
def test_an_estimated_angle_is_not_compared_with_a_measured_one(guessed: str) -> None:
    old, new = (
        replace(parameter("knee_flexion_rom_deg", v, "left"), estimated=k == guessed)
        for k, v in (("before", 52.4), ("after", 79.2))
    )
    (result,) = parameter_changes([old], [new])
    assert (result.verdict, result.difference, result.reason) == (None, None, "not_measured_alike")
    assert (result.before, result.after) == (52.4, 79.2)
    (alike,) = parameter_changes([replace(old, estimated=True)], [replace(new, estimated=True)])
    assert alike.difference == pytest.approx(26.8)


@pytest.mark.parametrize(
    ("before", "after", "limit", "verdict"),
    [
        (0.35, 0.44, 0.10, "within_measurement_error"),
        (0.35, 0.46, 0.10, "real_change"),
        (0.35, 0.52, 0.10, "clinically_relevant"),
        (0.60, 0.74, 0.15, "within_measurement_error"),
        (0.60, 0.755, 0.15, "real_change"),
        (0.60, 0.78, 0.15, "clinically_relevant"),
        (1.00, 1.17, 0.18, "within_measurement_error"),
        (1.00, 0.80, 0.18, "clinically_relevant"),
    ],
)
def test_gait_speed_has_limits_by_the_speed_before(
    before: float, after: float, limit: float, verdict: str
) -> None:
    """Lewek 2019 by strata; Tilson 2010: 0.16 m/s matters, but not below the measurement error."""
    result = one("gait_speed_mps", before, after)
    assert (result.limit, result.verdict, result.mcid) == (limit, verdict, 0.16)
    assert "Lewek" in str(result.limit_source)
    assert "stroke" in str(result.people)


def test_the_range_of_the_knee_has_limits_by_limb() -> None:
    """Guzik 2020: SEM 1.86° and 5.63°, MCID 8.48° and 6.81°."""
    left = one("knee_flexion_rom_deg", 40.0, 47.0, "left", affected="left")
    assert left.limit == pytest.approx(5.16, abs=0.01)
    assert (left.verdict, left.mcid) == ("real_change", 8.48)
    right = one("knee_flexion_rom_deg", 40.0, 47.0, "right", affected="left")
    assert right.limit == pytest.approx(15.6, abs=0.01)
    assert (right.verdict, right.mcid) == ("within_measurement_error", 6.81), "7° matters, but may be error"
    nobody = one("knee_flexion_rom_deg", 40.0, 47.0, "left")
    assert nobody.limit == right.limit, "no side affected: the larger limit"


def test_what_has_no_limit_has_no_verdict() -> None:
    result = one("foot_pitch_ic_deg", 10.0, 20.0, "left")
    assert (result.verdict, result.reason, result.difference) == (None, "no_mdc", 10.0)
    missing = one("gait_speed_mps", None, 1.0)
    assert (missing.verdict, missing.reason, missing.difference) == (None, "no_value", None)
    (new,) = parameter_changes([], [parameter("gait_speed_mps", 1.0, None, "m/s")])
    assert new.reason == "no_value"


def test_few_wild_strides_widen_the_limit() -> None:
    """The published 6.7 cm takes a steady mean for granted; five strides ± 8 cm are not one."""
    rng = np.random.default_rng(1)
    initial, final = (
        summarise_values("step_length_m", "left", (m + 0.08 * rng.standard_normal(5)).tolist(), "m")
        for m in (0.40, 0.50)
    )
    (result,) = parameter_changes([initial], [final])
    assert result.limit is not None
    assert result.limit > 0.067
    assert result.limit_source == "strides and measurement of the two visits, 95 %"
    many = [summarise_values("step_length_m", "left", [m - 0.01, m + 0.01] * 30, "m") for m in (0.40, 0.50)]
    (steady,) = parameter_changes([many[0]], [many[1]])
    assert (steady.limit, steady.verdict) == (0.067, "real_change")


def test_own_repeated_measurements_go_before_published_limits() -> None:
    repeatability = estimate_repeatability(
        [[60.0, 62.0], [50.0, 51.0], [55.0, 55.0], [70.0, 72.0], [64.0, 63.0]]
    )
    assert repeatability is not None
    change = one("knee_flexion_rom_deg", 50.0, 53.0, "left", own={"knee_flexion_rom_deg": repeatability})
    assert change.verdict == "real_change"
    assert "own repeated" in str(change.limit_source)


def test_a_change_towards_the_norm_is_told_where_the_norm_compares() -> None:
    norm = {"gait_speed_mps": NormValue("gait_speed_mps", 1.17, 0.16, None, "g", "s")}
    assert one("gait_speed_mps", 0.6, 0.8, norms=(norm, norm)).towards_norm is True
    assert one("gait_speed_mps", 1.2, 1.5, norms=(norm, norm)).towards_norm is False
    assert one("gait_speed_mps", 0.6, 0.8).towards_norm is None


def test_each_visit_is_placed_in_the_norm_at_its_own_speed() -> None:
    """Double support 31.6 % at a speed at which 37.7 ± 4.5 is usual, then 27.2 where 30.2 ± 4.5 is."""
    name = "double_support_pct"
    slow, faster = ({name: NormValue(name, m, 4.5, 52, "g", "s")} for m in (37.7, 30.2))
    assert one(name, 31.6, 27.2, norms=(slow, faster)).towards_norm is True
    assert one(name, 31.6, 27.2, norms=(faster, faster)).towards_norm is False
    assert one(name, 31.6, 27.2, norms=({}, faster)).towards_norm is None
    assert one(name, 31.6, 27.2, norms=(slow, {})).towards_norm is None
    second = {name: replace(slow[name], comparable=False)}
    assert one(name, 31.6, 27.2, norms=(second, faster)).towards_norm is None


def test_levels_from_standing_say_so() -> None:
    assert one("knee_flexion_max_swing_deg", 40.0, 55.0, "left").note == "from_standing"
    assert one("knee_flexion_rom_deg", 40.0, 55.0, "left").note is None
    assert one("foot_pitch_ic_deg", 4.0, 9.0, "left").note is None


def test_ratios_have_limits_with_the_affected_side_first() -> None:
    """Lewek & Randall 2011: stance 0.09, step length 0.15, swing 0.26."""

    def session(left: float, right: float, affected: Side | None) -> tuple[Change, ...]:
        rows = [parameter("stance_time_s", v, s, "s") for s, v in zip(SIDES, (left, right), strict=True)]
        even = [parameter("stance_time_s", 0.70, s, "s") for s in SIDES]
        return ratio_changes(compare_sides(rows, affected), compare_sides(even, affected))

    (change,) = session(0.60, 0.75, "left")
    assert change.difference == pytest.approx(0.2)
    assert (change.name, change.limit, change.verdict) == ("stance_time_s_ratio", 0.09, "real_change")
    (small,) = session(0.66, 0.70, "left")
    assert small.verdict == "within_measurement_error"
    (sides,) = session(0.60, 0.75, None)
    assert (sides.verdict, sides.reason) == (None, "no_mdc")


def score(value: float | None, mode: str = "raw", name: str = "gps_deg", unit: str = "deg") -> Score:
    return Score(name, None, None, mode, value, unit, 20, None)  # type: ignore[arg-type]


def test_scores_know_their_way_but_no_error_of_their_own() -> None:
    (better,) = score_changes([score(9.0)], [score(7.0)])
    assert (better.verdict, better.reason, better.mcid) == (None, "no_mdc", 1.6)
    assert better.towards_norm is True
    (index,) = score_changes(
        [score(70.0, name="gdi_star", unit="points")], [score(80.0, name="gdi_star", unit="points")]
    )
    assert (index.towards_norm, index.mcid) == (True, None)
    own = estimate_repeatability([[5.0, 5.4]] * 6)
    assert own is not None
    (verdicts,) = score_changes([score(9.0)], [score(7.0)], {score_name(score(1.0)): own})
    assert verdicts.verdict == "clinically_relevant"


def test_raw_and_shape_are_never_compared() -> None:
    (result,) = score_changes([score(9.0, "raw")], [score(4.0, "offset_removed")])
    assert (result.reason, result.difference) == ("no_value", None)
