"""Norms at the person's speed: shipped tables, continuity with comfortable norms, range."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY, SIDES
from sagittal.core.norms import (
    adult_kinematics,
    adult_reference,
    adult_reference_at_speed,
    angle_values,
    look_up_norms,
)
from sagittal.core.norms.at_speed import (
    ASKED,
    angle_values_at_speed,
    bands_at_speed,
    curve_models,
    is_matched,
    walkway_values_at_speed,
)
from sagittal.core.norms.profile import NINE, SAGITTAL
from sagittal.core.norms.scores import score_curves
from sagittal.core.norms.speed import COMFORTABLE, NORM_LEG_M, SLOWEST, walking_speed
from sagittal.core.norms.tables import read_rows
from tests.core.norms.test_scores import session

FIGURES = {
    "knee_flexion_peak_swing": "knee_flexion_max_swing_deg",
    "knee_flexion_peak_loading": "knee_flexion_max_loading_deg",
    "knee_flexion_IC": "knee_flexion_ic_deg",
    "knee_min_stance": "knee_flexion_min_stance_deg",
    "knee_ROM": "knee_flexion_rom_deg",
    "ankle_dorsiflexion_peak_stance": "ankle_dorsiflexion_max_stance_deg",
    "ankle_plantarflexion_peak_pushoff": "ankle_dorsiflexion_min_deg",
    "ankle_dorsiflexion_peak_swing": "ankle_dorsiflexion_max_swing_deg",
    "ankle_ROM": "ankle_dorsiflexion_rom_deg",
}


def v_star(speed_mps: float) -> float:
    return speed_mps / sqrt(GRAVITY * NORM_LEG_M)


def test_the_curves_of_all_adults_are_those_of_the_table() -> None:
    """The table was made apart from this code, with g = 9.81: it agrees within its rounding."""
    rows: dict[tuple[str, float], list[tuple[float, float]]] = {}
    for r in read_rows("norm_speed_matched_adult"):
        key = r["variable"], float(r["speed_m_s_at_leg_0.828"])
        rows.setdefault(key, []).append((float(r["mean_deg"]), float(r["sd_deg"])))
    assert len(rows) == 7 * 21
    usual = adult_kinematics(None).bands
    for (variable, speed), table in rows.items():
        mean, sd = np.array(table).T
        result = bands_at_speed(None, v_star(speed))[variable]
        assert np.abs(result.mean_deg - mean).max() < 0.02
        # a single side spreads more than the table's mean of both, by as much at every speed
        comfortable = np.array(rows[variable, 1.25])[:, 1]
        assert result.sd_deg / usual[variable].sd_deg == pytest.approx(sd / comfortable, abs=0.01)


@pytest.mark.parametrize("age", [30, 70, None])
def test_at_comfortable_speed_both_norms_are_one(age: float | None) -> None:
    usual, met = adult_kinematics(age).bands, bands_at_speed(age, COMFORTABLE)
    for variable, band in met.items():
        assert band.mean_deg == pytest.approx(usual[variable].mean_deg, abs=1e-9)
        assert band.sd_deg == pytest.approx(usual[variable].sd_deg, abs=1e-9)
    known_values = angle_values(age).values
    for name, value in angle_values_at_speed(age, COMFORTABLE).items():
        assert value.mean == pytest.approx(known_values[name].mean, abs=1e-9)


def test_figures_are_means_of_individual_figures_not_figures_of_the_mean_curve() -> None:
    for row in read_rows("discrete_mean_of_peaks_by_speed"):
        name = FIGURES.get(row["parameter (WBDS-anchored by constant)"])
        if name is None:
            continue
        for speed in (0.25, 0.3, 0.5, 0.8, 1.0, 1.25):
            result = angle_values_at_speed(None, v_star(speed))[name]
            printed = float(row[f"{speed}"])
            assert result.mean == pytest.approx(printed, abs=0.13), (name, speed)
    slow = v_star(0.3)
    knee = bands_at_speed(None, slow)["knee_flexion"].mean_deg
    peak = angle_values_at_speed(None, slow)["knee_flexion_max_swing_deg"].mean
    assert peak - knee[50:].max() == pytest.approx(10.7, abs=0.1), (
        "slow walking smears the moment of the peak"
    )


@pytest.mark.parametrize(("speed", "spread"), [(0.3, 5.58), (0.5, 4.99), (0.9, 3.51), (1.2, 3.75)])
def test_the_spread_of_a_figure_is_what_a_person_left_out_departs_from_it(
    speed: float, spread: float
) -> None:
    result = angle_values_at_speed(None, v_star(speed))["knee_flexion_max_swing_deg"]
    assert result.sd == pytest.approx(np.hypot(spread, 3.40 / 2), abs=0.01), "of a single side"
    assert result.n == 52


def test_times_and_distances_agree_with_the_people_measured_at_that_speed() -> None:
    """Means of the bins of 0.1 m/s, for steps of 2.4 cm and cadence of 5/min at most; all within an sd."""
    observations = 0
    for r in read_rows("spatiotemporal_by_speed_bin_rehazenter52"):
        v = float(r["dimensionless_speed_mean"])
        if not is_matched(v):
            continue
        observations += 1
        sparse = int(r["n_subjects"]) < 10  # the gap between two conditions
        leg = (float(r["speed_mean"]) / v) ** 2 / GRAVITY
        result = walkway_values_at_speed(v, leg)
        for name, column, least in (
            ("stance_pct", "stance_pct", 0.85),
            ("initial_double_support_pct", "initial_double_support_pct", 0.85),
            ("step_length_m", "step_length_m", 0.025),
            ("cadence_spm", "cadence", 5.0),
        ):
            off = abs(result[name].mean - float(r[f"{column}_mean"]))
            assert off <= float(r[f"{column}_std"]), (name, v)
            assert off <= least or sparse, (name, v)
            assert off <= result[name].sd * (1.5 if sparse else 0.7), (name, v)
    assert observations >= 9


def test_steps_and_cadence_give_the_speed() -> None:
    for speed in (0.25, 0.5, 0.8, 1.2):
        results = walkway_values_at_speed(v_star(speed), NORM_LEG_M)
        result = results["step_length_m"].mean * results["cadence_spm"].mean / 60.0
        assert result == pytest.approx(speed, rel=0.02)
        assert results["stride_time_s"].mean == pytest.approx(2.0 * results["step_time_s"].mean)
        stance, double = results["stance_pct"].mean, results["double_support_pct"].mean
        assert results["swing_pct"].mean == pytest.approx(100.0 - stance)
        assert double == pytest.approx(2.0 * results["initial_double_support_pct"].mean, abs=1.3)


@pytest.mark.parametrize(
    ("speed", "stance", "step", "cadence"), [(0.3, 75.3, 0.403, 44.8), (0.8, 65.8, 0.559, 86.1)]
)
def test_slow_healthy_walking_in_figures(speed: float, stance: float, step: float, cadence: float) -> None:
    norms = look_up_norms(None, None, speed)
    assert norms.values["stance_pct"].mean == pytest.approx(stance, abs=0.05)
    assert norms.values["step_length_m"].mean == pytest.approx(step, abs=0.002)
    assert norms.values["cadence_spm"].mean == pytest.approx(cadence, abs=0.2)
    assert {norms.values[n].group for n in ("cadence_spm", "knee_flexion_rom_deg")} == {ASKED}
    assert (norms.reason, norms.timing_reason) == (None, None), "neither age nor sex is needed"


def test_both_norms_are_there_below_comfortable_speed_and_one_above() -> None:
    slow = look_up_norms(60, "female", 0.6, 1.65)
    assert set(slow.bands) == set(slow.comfortable_bands) == set(curve_models())
    assert slow.bands["knee_flexion"].group == ASKED
    assert slow.comfortable_bands["knee_flexion"].group == "adult_55_84"
    assert slow.comfortable["knee_flexion_rom_deg"].mean > slow.values["knee_flexion_rom_deg"].mean + 5.0
    middle = look_up_norms(60, "female", 1.0, 1.65)
    assert set(middle.bands) == set(adult_kinematics(60).bands), "rotation has no model and keeps its band"
    assert "hip_rotation" not in middle.comfortable_bands
    brisk = look_up_norms(60, "female", 1.4, 1.65)
    assert (brisk.comfortable, brisk.comfortable_bands) == ({}, {})
    assert brisk.bands["knee_flexion"].group == "adult_55_84"


def test_the_leg_is_measured_as_in_the_source() -> None:
    assert walking_speed(1.0, 1.70).norm_leg_m == pytest.approx(0.472 * 1.70)
    assert walking_speed(1.0, leg_m=0.90).norm_leg_m == pytest.approx(0.801)
    assert walking_speed(1.25).norm_speed == pytest.approx(COMFORTABLE)
    assert is_matched(SLOWEST)
    assert not is_matched(SLOWEST - 1e-6)
    assert not is_matched(COMFORTABLE)


def test_on_a_treadmill_steps_are_held_against_people_on_a_belt() -> None:
    """At 0.5 m/s they take steps of 0.39 m, 77 a minute; overground 0.47 m, 64 a minute."""
    floor, belt = (look_up_norms(40, "male", 0.5, treadmill=t).values for t in (False, True))
    assert (floor["step_length_m"].mean, floor["cadence_spm"].mean) == pytest.approx((0.472, 63.8), abs=0.1)
    assert (belt["step_length_m"].mean, belt["cadence_spm"].mean) == pytest.approx((0.39, 77.0), abs=1.5)
    assert "treadmill" in belt["cadence_spm"].group
    assert "stance_pct" not in belt
    assert belt["knee_flexion_rom_deg"].mean == floor["knee_flexion_rom_deg"].mean
    slower = look_up_norms(40, "male", 0.4, treadmill=True)
    assert "cadence_spm" not in slower.values, "nobody on a belt walked slower than 0.5 m/s"
    assert slower.place("cadence_spm", 70.0).reason == "no_speed_matched_norm"


def test_children_are_not_held_against_slow_adults() -> None:
    child = look_up_norms(9, "female", 0.6)
    assert (child.comfortable, dict(child.bands)) == ({}, {})
    assert adult_reference_at_speed(9, walking_speed(0.6)) is None


def test_a_slow_healthy_walker_scores_low_against_the_matched_norm_only() -> None:
    speed = walking_speed(0.4)
    matched = adult_reference_at_speed(40, speed)
    assert matched is not None
    walk = session({v: dict.fromkeys(SIDES, matched.mean_deg[v]) for v in matched.mean_deg})
    at_speed, usual = score_curves(walk, reference=matched), score_curves(walk)
    assert at_speed.speed_matched
    assert not usual.speed_matched
    own, far = (x.find("gps_sagittal_deg", "offset_removed", "left").value for x in (at_speed, usual))
    assert own == pytest.approx(0.0, abs=1e-9)
    assert far is not None
    assert far > 6.0, "half of what is called abnormal would be slowness"
    full = at_speed.find("gps_deg", "offset_removed", "left")
    assert (full.value, full.missing) == (None, ("hip_rotation", "foot_progression"))
    assert set(NINE) - set(matched.mean_deg) == set(full.missing)


def test_healthy_scores_spread_more_at_slow_speed() -> None:
    usual, slow = adult_reference(), adult_reference_at_speed(40, walking_speed(0.3))
    assert slow is not None
    for name in (*SAGITTAL, "gps_sagittal_side"):
        a, b = usual.spreads["raw"][name], slow.spreads["raw"][name]
        grown = b.mean_deg / a.mean_deg
        assert 1.0 < grown < 1.6
        assert b.p95_deg / a.p95_deg == pytest.approx(grown)
        if a.mean_ln is not None and b.mean_ln is not None:
            assert b.mean_ln - a.mean_ln == pytest.approx(np.log(grown))
