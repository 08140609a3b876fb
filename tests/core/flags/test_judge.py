"""Values against limits, by hand: side, zero, limit, and cases without a statement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from sagittal.core.flags import RULES, Flag, classify_ambulation, judge_flags
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.norms.controls import ControlSession, control_group
from sagittal.core.norms.tables import WBDS
from sagittal.core.parameters.result import CycleCurves, Parameter


def curves(values: Mapping[str, tuple[float, float]], strides: int = 10) -> CycleCurves:
    """Left and right of variables that are constant over the cycle, degrees."""
    rows: dict[str, dict[Side, Floats]] = {
        name: {s: np.full((strides, 101), np.radians(v)) for s, v in zip(SIDES, pair, strict=True)}
        for name, pair in values.items()
    }
    return CycleCurves(
        rows,
        dict.fromkeys(SIDES, tuple(range(strides))),
        {s: np.ones(strides, np.bool_) for s in SIDES},
        {s: np.full(strides, 62.0) for s in SIDES},
    )


def sides(
    name: str, left: float | None, right: float | None, unit: str = "m", n: int = 10, sd: float = 0.01
) -> list[Parameter]:
    pair = zip(SIDES, (left, right), strict=True)
    return [
        Parameter(name, s, 0, None, None, unit, "no_strides")
        if v is None
        else Parameter(name, s, n, v, sd, unit)
        for s, v in pair
    ]


def flag(result: tuple[Flag, ...], name: str, side: Side | None) -> Flag:
    (one,) = (f for f in result if f.name == name and f.side == side)
    return one


def test_sides_are_given_left_then_right() -> None:
    assert SIDES == ("left", "right")


def test_every_rule_names_its_source_and_says_whether_it_was_read() -> None:
    assert len({r.name for r in RULES}) == len(RULES)
    for rule in RULES:
        assert rule.source
        assert rule.verified or "not confirmed" in rule.source or "no confirmed source" in rule.source
    unread = {r.name for r in RULES if not r.verified}
    assert unread == {
        "knee_hyperextension", "low_dorsiflexion_swing", "flat_contact", "step_length_asymmetry",
        "stance_asymmetry", "swing_asymmetry",
    }  # fmt: skip


def test_a_stiff_knee_is_found_by_the_other_knee() -> None:
    flags = judge_flags(curves({"knee_flexion": (40.0, 58.0)}), [])
    left, right = (flag(flags, "stiff_knee", s) for s in SIDES)
    assert (left.exceeded, right.exceeded) == (True, False)
    assert left.value == pytest.approx(18.0)
    assert right.value == pytest.approx(-18.0)
    assert (left.limit, left.n, left.zero) == (17.0, 10, "standing")
    assert left.note == "sides_stand_differently"


def test_a_knee_that_stands_bent_is_not_stiff_once_the_goniometer_says_so() -> None:
    bent = curves({"knee_flexion": (40.0, 58.0)})
    flags = judge_flags(bent, [], {"knee_flexion_l": 12.0, "knee_flexion_r": 0.0})
    left = flag(flags, "stiff_knee", "left")
    assert (left.exceeded, left.zero, left.note) == (False, "anatomical", None)
    assert left.value == pytest.approx(6.0)
    half = flag(judge_flags(bent, [], {"knee_flexion_l": 12.0}), "stiff_knee", "left")
    assert half.value == pytest.approx(18.0), "one side entered: both are compared from standing"


@pytest.mark.parametrize(
    ("name", "variable", "angle", "exceeded", "marked"),
    [
        ("knee_hyperextension", "knee_flexion", -9.5, True, True),
        ("knee_hyperextension", "knee_flexion", -6.0, True, False),
        ("knee_hyperextension", "knee_flexion", -3.0, False, False),
        ("low_knee_flexion_swing", "knee_flexion", 44.0, True, False),
        ("low_knee_flexion_swing", "knee_flexion", 45.0, False, False),
        ("low_dorsiflexion_swing", "ankle_dorsiflexion", -1.0, True, False),
        ("low_hip_extension", "hip_flexion", 6.0, True, False),
        ("low_hip_extension", "hip_flexion", 5.0, False, False),
    ],
)
def test_levels_are_judged_from_the_anatomical_zero_only(
    name: str, variable: str, angle: float, exceeded: bool, marked: bool
) -> None:
    walked = curves({variable: (angle - 4.0, angle - 4.0)})
    blind = flag(judge_flags(walked, []), name, "left")
    assert (blind.exceeded, blind.marked, blind.reason) == (None, False, "angle_zero_standing")
    assert blind.value == pytest.approx(angle - 4.0)
    assert blind.zero == "standing"
    known_flag = flag(judge_flags(walked, [], {f"{variable}_l": 4.0}), name, "left")
    assert (known_flag.exceeded, known_flag.marked, known_flag.zero) == (exceeded, marked, "anatomical")
    assert known_flag.value == pytest.approx(angle)


def test_hip_hiking_is_two_standard_deviations_of_a_single_side_above_the_norm() -> None:
    """0.35 + 2 · 1.63: the 1.10 of the table is of the mean of both sides, where one side's rise is lost."""
    flags = judge_flags(curves({"pelvis_obliquity": (3.7, -3.7)}), [])
    left = flag(flags, "hip_hiking", "left")
    assert left.limit == pytest.approx(3.61, abs=0.01)
    assert (left.exceeded, flag(flags, "hip_hiking", "right").exceeded) == (True, False)
    assert WBDS in left.source


def test_ranges_compare_without_any_zero() -> None:
    swing = np.zeros((10, 101))
    swing[:, 72] = np.radians(60.0)
    stiff = swing * 0.8
    cycle_curves = curves({"knee_flexion": (0.0, 0.0)})
    cycle_curves = CycleCurves(
        {"knee_flexion": {"left": stiff, "right": swing}},
        cycle_curves.stride_index,
        cycle_curves.used,
        cycle_curves.foot_off_pct,
    )
    left = flag(judge_flags(cycle_curves, []), "knee_range_asymmetry", "left")
    assert left.value == pytest.approx(12.0)
    assert left.limit == pytest.approx(2 * 3.77)
    assert (left.exceeded, left.zero, left.note) == (True, None, None)


def test_a_ratio_belongs_to_the_larger_side() -> None:
    steps = sides("step_length_m", 0.50, 0.56)
    result = flag(judge_flags(None, steps), "step_length_asymmetry", "right")
    assert (result.exceeded, result.verified, result.note) == (True, False, None)
    assert result.value == pytest.approx(1.12)
    times = sides("stance_time_s", 0.70, 0.71, "s") + sides("swing_time_s", 0.40, 0.39, "s")
    even = judge_flags(None, times)
    assert flag(even, "stance_asymmetry", "right").exceeded is False
    assert flag(even, "temporal_asymmetry", "left").value == pytest.approx((0.40 / 0.70) / (0.39 / 0.71))
    assert flag(even, "temporal_asymmetry", "left").note is None


def test_three_strides_of_a_side_are_held_against_no_limit() -> None:
    result = flag(
        judge_flags(None, sides("step_length_m", 0.50, 0.70, n=3)), "step_length_asymmetry", "right"
    )
    assert (result.exceeded, result.reason) == (None, "too_few_strides")
    assert result.value == pytest.approx(1.4)
    foot = sides("foot_pitch_ic_deg", -9.0, 20.0, "deg", n=3)
    assert flag(judge_flags(None, foot), "flat_contact", "left").reason == "too_few_strides"
    stiff = flag(judge_flags(curves({"knee_flexion": (20.0, 60.0)}, strides=3), []), "stiff_knee", "left")
    assert (stiff.exceeded, stiff.reason) == (None, "too_few_strides")


def test_a_difference_that_the_strides_leave_open_is_beyond_no_limit() -> None:
    """0.50 ± 0.20 and 0.60 ± 0.20 m over ten strides: 95 % of the difference −0.29 … 0.09 m."""
    open_ = flag(
        judge_flags(None, sides("step_length_m", 0.50, 0.60, sd=0.2)), "step_length_asymmetry", "right"
    )
    assert (open_.exceeded, open_.marked, open_.reason) == (None, False, "sides_alike")
    inside = flag(
        judge_flags(None, sides("step_length_m", 0.50, 0.52, sd=0.2)), "step_length_asymmetry", "right"
    )
    assert inside.exceeded is False


def test_a_step_of_no_length_has_no_ratio() -> None:
    result = flag(judge_flags(None, sides("step_length_m", 0.5, -0.01)), "step_length_asymmetry", None)
    assert (result.value, result.exceeded, result.reason) == (None, None, "near_zero")


def test_circumduction_is_held_against_own_controls_or_nothing() -> None:
    """No table knows how far healthy feet swing out: limits are own controls'."""
    wide = sides("circumduction_m", 0.12, 0.03)
    single_flag = flag(judge_flags(None, wide), "circumduction", "left")
    assert (single_flag.value, single_flag.limit, single_flag.exceeded, single_flag.reason) == (
        0.12,
        None,
        None,
        "no_controls",
    )
    people = [
        ControlSession(f"c{i}", 40.0, "male", sides("circumduction_m", 0.02 + 0.002 * i, 0.03), {})
        for i in range(6)
    ]
    flags = judge_flags(None, wide, controls=control_group(people).norms())
    left, right = (flag(flags, "circumduction", s) for s in SIDES)
    assert left.limit is not None
    assert 0.03 < left.limit < 0.04
    assert (left.exceeded, right.exceeded, left.reason) == (True, False, None)
    assert "6 controls of this clinic" in left.source


def walked_at(speed_mps: float) -> tuple[Flag, ...]:
    speed = [Parameter("gait_speed_mps", None, 20, speed_mps, 0.1, "m/s")]
    walked = {"pelvis_obliquity": (5.0, 0.0), "knee_flexion": (30.0, 60.0), "hip_flexion": (9.0, 9.0)}
    return judge_flags(curves(walked), speed, {"hip_flexion_l": 0.0, "hip_flexion_r": 0.0})


@pytest.mark.parametrize("name", ["hip_hiking", "low_hip_extension"])
def test_limits_of_healthy_adults_are_those_of_adults_at_this_speed(name: str) -> None:
    slow, usual = (flag(walked_at(v), name, "left") for v in (0.5, 1.25))
    assert (slow.exceeded, usual.exceeded) == (slow.value > slow.limit, True)  # type: ignore[operator]
    assert slow.limit != pytest.approx(usual.limit, abs=1e-3)
    assert slow.spread is not None
    assert usual.spread is not None
    assert slow.spread > usual.spread
    assert "Schreiber" in slow.source


@pytest.mark.parametrize("speed_mps", [0.15, 1.75])
def test_limits_of_healthy_adults_are_not_applied_at_a_speed_at_which_none_walked(speed_mps: float) -> None:
    result = walked_at(speed_mps)
    for rule in RULES:
        if rule.adults != "limit":
            continue
        for side in SIDES:
            source = flag(result, rule.name, side)
            assert (source.exceeded, source.limit, source.certain) == (None, None, False)
            assert source.value is None or source.reason == "no_speed_matched_norm"
    stiff = flag(result, "stiff_knee", "left")
    assert (stiff.exceeded, stiff.note) == (True, "sides_stand_differently"), "its limit is of patients"


def test_children_are_not_held_against_adult_norms() -> None:
    walked = curves({"pelvis_obliquity": (5.0, 0.0), "knee_flexion": (30.0, 60.0)})
    hike = flag(judge_flags(walked, [], age=9), "hip_hiking", "left")
    assert hike.value == pytest.approx(5.0)
    assert (hike.limit, hike.exceeded, hike.reason) == (None, None, "no_norm_for_age")
    assert flag(judge_flags(walked, [], age=9), "stiff_knee", "left").exceeded is True
    assert flag(judge_flags(walked, [], age=40), "hip_hiking", "left").exceeded is True


def test_nothing_measured_gives_reasons_and_no_flag() -> None:
    flags = judge_flags(None, [])
    assert {f.exceeded for f in flags} == {None}
    assert all(f.reason for f in flags)
    assert {f.name for f in flags} == {r.name for r in RULES}
    none = curves({"knee_flexion": (50.0, 50.0)}, strides=0)
    assert flag(judge_flags(none, []), "stiff_knee", "left").reason == "no_strides"


@pytest.mark.parametrize(
    ("speed", "group"),
    [(0.39, "household"), (0.4, "limited_community"), (0.8, "limited_community"), (0.81, "community")],
)
def test_classes_of_walking_by_speed(speed: float, group: str) -> None:
    assert classify_ambulation(speed) == group
