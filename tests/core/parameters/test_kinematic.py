"""Cycle curves and their figures on angles whose course over the cycle is known."""

from __future__ import annotations

import csv
import gzip
import time
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.angles import JointAngles, compute_headings
from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import SIDES, Bools, Floats, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.norms import adult_kinematics
from sagittal.core.parameters import cycle_curves, foot_pitch, gait_parameters, mean_curve, summarise_angles
from sagittal.core.parameters.catalogue import list_curve_figures
from sagittal.core.parameters.kinematic import measure_cycles, per_stride_figures, stride_figures
from sagittal.core.parameters.result import CycleCurves
from tests.core.events.foot_signal import orientations
from tests.data import data_folder
from tests.helpers.walks import simulated

RATE = 100.0
T = np.arange(3000) / RATE
SIZE = 0.3
"""Of a wave that a knee can follow, rad."""


def strides(n: int = 8, duration: float = 1.13, reason: str | None = None) -> Strides:
    """`n` cycles of each side from t = 1 s, the left half a cycle later; the third of each not counted."""
    shifts: dict[Side, float] = {"right": 0.0, "left": duration / 2}
    return Strides(
        tuple(
            Stride(
                side,
                1.0 + shift + i * duration,
                1.0 + shift + (i + 0.62) * duration,
                1.0 + shift + (i + 1) * duration,
                excluded_reason="turn" if i == 2 else reason,
            )
            for i in range(n)
            for side, shift in shifts.items()
        )
    )


def wave(duration: float = 1.13, shift: float = 0.0) -> Floats:
    """One sine per cycle, in rad."""
    return np.asarray(np.sin(2 * np.pi * (T - 1.0 - shift) / duration))


def angles(**named: Floats) -> JointAngles:
    return JointAngles(T, named, dict.fromkeys(named, 0.0))


def test_a_curve_is_the_angle_at_each_percent_of_the_cycle() -> None:
    curves = cycle_curves(angles(knee_flexion_r=SIZE * wave()), strides())
    rows = curves.curves["knee_flexion"]["right"]
    assert rows.shape == (8, 101)
    expected = SIZE * np.sin(2 * np.pi * np.linspace(0, 1, 101))
    # linear interpolation of a sine: at most (2π·dt/T)²/8
    assert np.abs(rows - expected).max() <= (2 * np.pi / RATE / 1.13) ** 2 / 8 + 1e-9
    assert "left" not in curves.curves["knee_flexion"]
    assert curves.foot_off_pct["right"] == pytest.approx(62.0)
    assert curves.used["right"].tolist() == [True, True, False, *[True] * 5]


def test_row_i_belongs_to_the_stride_it_names() -> None:
    listed = strides()
    curves = cycle_curves(
        angles(knee_flexion_l=SIZE * wave(shift=0.565), knee_flexion_r=SIZE * wave()), listed
    )
    for side in ("left", "right"):
        named = [listed.strides[i] for i in curves.stride_index[side]]
        assert all(s.side == side for s in named)
        assert np.array_equal(curves.used[side], [s.excluded_reason is None for s in named])


def test_a_gap_empties_the_rows_that_touch_it_and_no_other() -> None:
    knee = SIZE * wave()
    knee[round((1.0 + 1.13 * 3.5) * RATE) : round((1.0 + 1.13 * 3.5) * RATE) + 15] = np.nan
    curves = cycle_curves(angles(knee_flexion_r=knee, hip_flexion_r=wave()), strides())
    lost = np.isnan(curves.curves["knee_flexion"]["right"])
    assert lost.all(axis=1).tolist() == [False, False, False, True, *[False] * 4]
    assert np.array_equal(lost.any(axis=1), lost.all(axis=1))
    assert np.isfinite(curves.curves["hip_flexion"]["right"]).all()
    assert mean_curve(curves, "knee_flexion", "right").n == 6
    (rom,) = (p for p in summarise_angles(curves) if p.name == "knee_flexion_rom_deg" and p.side == "right")
    assert rom.n == 6


def test_the_mean_is_over_counted_strides_and_nothing_is_none() -> None:
    curves = cycle_curves(angles(knee_flexion_r=SIZE * wave() + 0.1 * T), strides())
    mean = mean_curve(curves, "knee_flexion", "right")
    counted = curves.curves["knee_flexion"]["right"][curves.used["right"]]
    assert mean.n == 7
    assert mean.mean is not None
    assert mean.sd is not None
    assert np.array_equal(mean.mean, counted.mean(axis=0))
    assert np.array_equal(mean.sd, counted.std(axis=0, ddof=1))
    assert mean_curve(curves, "knee_flexion", "left").mean is None
    nothing = mean_curve(
        cycle_curves(angles(knee_flexion_r=SIZE * wave()), strides(0)), "knee_flexion", "right"
    )
    assert (nothing.mean, nothing.sd, nothing.n) == (None, None, 0)


def test_the_pelvis_appears_on_both_sides_with_that_side_up() -> None:
    curves = cycle_curves(angles(pelvis_obliquity=wave(), pelvis_tilt=wave()), strides())
    right, left = (curves.curves["pelvis_obliquity"][side] for side in ("right", "left"))
    assert right[0] == pytest.approx(np.sin(2 * np.pi * np.linspace(0, 1, 101)), abs=1e-3)
    # half a cycle later the sine is reversed, and so is the side that counts as up
    assert left[0] == pytest.approx(right[0], abs=1e-3)
    assert curves.curves["pelvis_tilt"]["left"][0] == pytest.approx(-right[0], abs=1e-3)


def test_figures_of_a_known_curve() -> None:
    rows = np.radians(np.linspace(-10.0, 60.0, 101))[None, :]
    mask: dict[Side, Bools] = {"left": np.array([True]), "right": np.array([], np.bool_)}
    curves = CycleCurves(
        {"knee_flexion": {"left": rows}}, {"left": (0,), "right": ()}, mask, {"left": np.array([60.0])}
    )
    values = {p.name: p.mean for p in summarise_angles(curves) if p.side == "left"}
    assert values["knee_flexion_ic_deg"] == pytest.approx(-10.0)
    assert values["knee_flexion_max_loading_deg"] == pytest.approx(11.0)
    assert values["knee_flexion_min_stance_deg"] == pytest.approx(4.0)
    assert values["knee_flexion_max_swing_deg"] == pytest.approx(60.0)
    assert values["knee_flexion_rom_deg"] == pytest.approx(70.0)
    assert values["hip_flexion_rom_deg"] is None
    reasons = {(p.name, p.side): p.reason for p in summarise_angles(curves)}
    assert reasons["hip_flexion_rom_deg", "left"] == "joint_missing"


def test_reasons_when_there_is_no_number() -> None:
    knee = np.full(3000, np.nan)
    all_lost = summarise_angles(cycle_curves(angles(knee_flexion_r=knee), strides()))
    assert {p.reason for p in all_lost if p.side == "right" and p.name.startswith("knee")} == {"gap"}
    none_used = summarise_angles(cycle_curves(angles(knee_flexion_r=SIZE * wave()), strides(reason="turn")))
    assert {p.reason for p in none_used if p.side == "right" and p.name.startswith("knee")} == {"no_strides"}


def test_foot_pitch_at_the_contacts() -> None:
    pitch = np.radians(20.0) * wave()
    take = orientations(RATE, {"foot_r": pitch})
    found = foot_pitch(take, strides())
    assert found["foot_pitch_ic_deg"]["right"] == pytest.approx(0.0, abs=0.02)
    assert found["foot_pitch_tc_deg"]["right"] == pytest.approx(20.0 * np.sin(2 * np.pi * 0.62), abs=0.02)
    assert "left" not in found["foot_pitch_ic_deg"]
    table = per_stride_figures(
        strides(), found | stride_figures(cycle_curves(angles(knee_flexion_r=SIZE * wave()), strides()))
    )
    assert table["foot_pitch_tc_deg"][1] is None
    assert table["foot_pitch_tc_deg"][0] == pytest.approx(found["foot_pitch_tc_deg"]["right"][0])
    assert len(table["knee_flexion_rom_deg"]) == 16


def test_all_parameters_in_one_table() -> None:
    take = orientations(RATE, {"foot_r": np.radians(20.0) * wave()})
    found = gait_parameters(strides(), angles(knee_flexion_r=SIZE * wave()), take)
    keys = [(p.name, p.side) for p in found]
    assert len(set(keys)) == len(keys)
    assert {"stride_time_s", "cadence_spm", "knee_flexion_rom_deg", "foot_pitch_ic_deg"} <= {
        k[0] for k in keys
    }
    assert all((p.mean is None) == (p.reason is not None) for p in found)
    assert all(p.mean is None or np.isfinite(p.mean) for p in found)


@pytest.mark.bench
def test_ten_minutes_of_curves_are_cut_within_50_ms() -> None:
    n = 60000
    names = [f"{j}_{s}" for j in FIGURES_AND_OTHERS for s in "lr"]
    t = np.arange(n) / RATE
    take = JointAngles(t, {name: np.sin(t) for name in names}, dict.fromkeys(names, 0.0))
    listed = Strides(
        tuple(Stride(side, 1.1 * i, 1.1 * i + 0.7, 1.1 * (i + 1)) for i in range(540) for side in SIDES)
    )
    cycle_curves(take, listed)
    took = []
    for _ in range(5):
        start = time.process_time()
        cycle_curves(take, listed)
        took.append(time.process_time() - start)
    assert min(took) < 0.050


FIGURES_AND_OTHERS = (
    "hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion", "knee_adduction", "knee_rotation",
    "ankle_dorsiflexion", "ankle_inversion", "ankle_rotation",
)  # fmt: skip


@pytest.mark.recorded
def test_our_figures_are_those_of_the_reference_table() -> None:
    """On the 84 reference strides our windows give the published means, and the spread of a single side."""
    from sagittal.core.norms import angle_values

    path = data_folder("norms") / "wbds_strides_42subjects.csv.gz"
    people: dict[str, dict[str, list[Floats]]] = {}
    with gzip.open(path, "rt", encoding="utf-8") as file:
        for r in csv.DictReader(file):
            row = np.array([float(r[f"p{i}"]) for i in range(101)])
            people.setdefault(r["variable"], {}).setdefault(r["subject"], []).append(row)
    reference = angle_values(None).values
    for name, figure in list_curve_figures().items():
        sides = []
        for rows in people[figure.variable].values():
            curves = CycleCurves(
                {figure.variable: {"left": np.radians(np.stack(rows))}},
                {"left": (0, 1), "right": ()},
                {"left": np.ones(len(rows), np.bool_), "right": np.zeros(0, np.bool_)},
                {},
            )
            sides.append(stride_figures(curves)[name]["left"])
        both = np.array(sides)
        assert both.mean() == pytest.approx(reference[name].mean, abs=0.02), name
        means, differences = both.mean(axis=1), both[:, 0] - both[:, 1]
        one_side = np.hypot(np.std(means, ddof=1), 0.5 * np.std(differences, ddof=1))
        assert one_side == pytest.approx(reference[name].sd, abs=0.02), name


def test_rotation_and_progression_have_the_side_that_goes_forward_or_inward() -> None:
    """Turning to the left brings the right hip forward and the right toes in, the left ones back and out."""
    turned = {"pelvis": wave(), "foot_l": wave(), "foot_r": wave()}
    curves = cycle_curves(replace(angles(), headings=turned), strides()).curves
    for variable in ("pelvis_rotation", "foot_progression"):
        right_row, left_row = curves[variable]["right"][0], curves[variable]["left"][0]
        assert right_row[:-1].mean() == pytest.approx(0.0, abs=1e-12)
        assert np.ptp(right_row) > 0.0
        at = cycle_curves(angles(pelvis_tilt=wave()), strides()).curves["pelvis_tilt"]
        np.testing.assert_allclose(right_row - right_row[0], at["right"][0] - at["right"][0][0], atol=1e-12)
        np.testing.assert_allclose(left_row - left_row[0], at["left"][0][0] - at["left"][0], atol=1e-12)


def test_the_simulated_pelvis_rotates_as_the_norm_it_was_made_from() -> None:
    """docs/science/simulation.md, "Target curves": rotation is the WBDS mean, antisymmetric between sides."""
    truth = simulated("healthy", 5)[1]
    there = dict.fromkeys(truth.q, np.ones(len(truth.t_s), bool))
    oriented = Orientations(truth.t_s, truth.rate_hz, truth.q, there, "truth")
    own = Strides(tuple(
        Stride(s.side, s.start_s, s.release_s, s.end_s) for s in truth.strides if abs(s.turn_rad) < 0.1
    ))  # fmt: skip
    curves = cycle_curves(JointAngles(truth.t_s, {}, {}, headings=compute_headings(oriented)), own)
    norm = adult_kinematics(None).bands["pelvis_rotation"].mean_deg
    for side in SIDES:
        rows = np.degrees(curves.curves["pelvis_rotation"][side])
        shape = np.median(rows, axis=0) - (norm - norm.mean())
        assert np.sqrt(np.mean(shape**2)) < 1.0, side


def test_figures_of_curves_that_are_let_go_of_are_those_of_all() -> None:
    # a knee that bends the wrong way in some strides, and an angle that was withheld
    knee = wave() * np.where(T > 6.0, 1.5, SIZE)
    take = replace(
        angles(knee_flexion_r=knee, hip_flexion_r=wave(), hip_flexion_l=wave(), pelvis_tilt=wave()),
        withheld={"ankle_flexion_r": "estimator_bad"},
        bounds={"knee_flexion_r": 0.1},
    )
    curves = cycle_curves(take, strides())
    known, figures = measure_cycles(take, strides())
    expected = stride_figures(curves)
    assert [(name, *x) for name, x in figures.items()] == [(name, *x) for name, x in expected.items()]
    for name, sides in expected.items():
        for side, values in sides.items():
            np.testing.assert_array_equal(figures[name][side], values)
    assert (known.curves, known.why, known.bounds) == ({}, curves.why, curves.bounds)
    assert summarise_angles(known, figures) == summarise_angles(curves)
