"""Repetitions and their measures on simulated squats, whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import radians

import numpy as np
import pytest

from sagittal.core.angles import JointAngles
from sagittal.core.angles.measure import measure_angles
from sagittal.core.body.chain.leg import LegMotion, estimate_leg
from sagittal.core.calibration.fixed_offset import make_fixed_mounts
from sagittal.core.calibration.known_mounts import FIXED_OFFSET, calibrate_with_mounts
from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats, Side
from sagittal.core.parameters.symmetry import compare_sides
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.simulate import SquatSimulation
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.squat_chain import measure_leg
from sagittal.core.squat.curves import CURVES, VALGUS
from sagittal.core.squat.measures import MEASURES, SquatSide, measure_squats
from sagittal.core.squat.repetitions import RepetitionParams, find_repetitions
from sagittal.core.timeline import synchronise
from tests.core.body.chain.squats import HEIGHT_M, squat_on

RATE = 100.0


@cache
def squatted(side: Side) -> tuple[SquatSimulation, CalibratedRecording, LegMotion, JointAngles]:
    simulation = squat_on(side, RATE, MEMS, repetitions=5)
    calibrated = calibrate_with_mounts(
        synchronise(simulation.recording), make_fixed_mounts(side), "fixed_offset", FIXED_OFFSET
    )
    leg = estimate_leg(calibrated, measure_leg(HEIGHT_M, side))
    return simulation, calibrated, leg, measure_angles(leg.orientations, calibrated.calibration.zero)


@cache
def measured(side: Side) -> SquatSide:
    _, calibrated, leg, angles = squatted(side)
    return measure_squats(angles, leg, side, calibrated.recording)


@pytest.mark.parametrize("side", ["right", "left"])
def test_repetitions_and_measures_are_the_true_ones(side: Side) -> None:
    result, measurement = squatted(side)[0], measured(side)
    truth, end = result.truth, side[0]
    assert [r.excluded for r in measurement.repetitions] == [None] * 5
    holds = [p for p in truth.phases if p.kind == "hold"]
    downs = [p for p in truth.phases if p.kind == "down"]
    ups = [p for p in truth.phases if p.kind == "up"]
    for r, down, hold, up in zip(measurement.repetitions, downs, holds, ups, strict=True):
        assert down.start_s < r.start_s < down.start_s + 0.5
        assert hold.start_s - 0.1 <= r.bottom_s <= hold.end_s + 0.1
        assert up.end_s - 0.5 < r.end_s < up.end_s
    assert measurement.values["squat_depth_deg"] == pytest.approx(
        np.degrees(_at_holds(result, f"knee_flexion_{end}")), abs=1.0
    )
    inward = _at_holds(result, f"hip_adduction_{end}") + _at_holds(result, f"hip_rotation_{end}")
    assert measurement.values["squat_knee_valgus_bottom_deg"] == pytest.approx(np.degrees(inward), abs=2.5)
    thigh = truth.p[f"thigh_{end}"][:, 2]  # type: ignore[index]
    drops = [thigh[0] - np.interp(0.5 * (p.start_s + p.end_s), truth.t_s, thigh) for p in holds]
    assert measurement.values["squat_hip_drop_m"] == pytest.approx(drops, abs=0.015)
    assert (
        measurement.values["squat_knee_valgus_deg"] >= measurement.values["squat_knee_valgus_bottom_deg"]
    ).all()
    total = measurement.values["squat_descent_s"] + measurement.values["squat_ascent_s"]
    assert measurement.values["squat_duration_s"] == pytest.approx(total)


def _at_holds(result: SquatSimulation, name: str) -> Floats:
    truth = result.truth
    middles = [0.5 * (p.start_s + p.end_s) for p in truth.phases if p.kind == "hold"]
    return np.interp(middles, truth.t_s, truth.subtract_standing()[name])


def test_curves_of_every_repetition() -> None:
    curves = measured("right").curves
    assert set(curves) == {*CURVES, VALGUS}
    assert all(c.shape == (5, 101) and np.isfinite(c).all() for c in curves.values())
    knee = curves["knee_flexion"]
    assert np.degrees(knee.max(axis=1)).min() > 60.0
    assert (knee[:, [0, -1]] < 0.1 * knee.max(axis=1)[:, None]).all()
    assert curves[VALGUS][:, 0] == pytest.approx(0.0)


def test_two_legs_are_compared_like_all_parameters() -> None:
    pair = (*measured("left").parameters, *measured("right").parameters)
    compared = {s.name: s for s in compare_sides(pair)}
    assert set(compared) == set(MEASURES)
    assert abs(compared["squat_depth_deg"].difference) < 1.0
    assert compared["squat_depth_deg"].reason == "angle"
    assert compared["squat_duration_s"].index_pct == pytest.approx(0.0, abs=5.0)
    assert all(p.n == 5 and p.mean is not None and p.sd is not None for p in pair)


def test_without_a_leg_or_a_squat_there_is_a_reason() -> None:
    _, _, leg, angles = squatted("right")
    other_squats = measure_squats(angles, leg, "left")
    assert {p.reason for p in other_squats.parameters} == {"no_angles"}
    still = replace(angles, angles={name: np.zeros_like(a) for name, a in angles.angles.items()})
    assert {p.reason for p in measure_squats(still, leg, "right").parameters} == {"no_repetitions"}
    assert all(p.mean is None and p.n == 0 for p in other_squats.parameters)


def course(*depths_deg: float, cycle_s: float = 4.0) -> tuple[Floats, Floats]:
    """Flexion (n,) of squats right after each other, and its times."""
    t = np.arange(round(cycle_s * len(depths_deg) * RATE) + 1) / RATE
    depth = np.array([*depths_deg, 0.0])[np.minimum((t / cycle_s).astype(int), len(depths_deg))]
    return np.radians(depth) * np.sin(np.pi * t / cycle_s) ** 2, t


def test_continuous_squats_are_told_apart_and_small_bends_are_none() -> None:
    knee, t = course(70.0, 60.0, 12.0, 80.0)
    repetitions = find_repetitions(knee, t, "right")
    assert [round(r.bottom_s) for r in repetitions] == [2, 6, 14]
    assert [round(float(np.degrees(knee[r.bottom]))) for r in repetitions] == [70, 60, 80]


def test_a_bounce_at_the_bottom_is_one_squat() -> None:
    t = np.arange(801) / RATE
    knee = np.radians(
        80.0 * np.clip(np.minimum(t, 8.0 - t) / 2.0, 0.0, 1.0) - 25.0 * np.exp(-(((t - 4.0) / 0.3) ** 2))
    )
    assert len(find_repetitions(knee, t, "right")) == 1


def test_what_the_take_cuts_is_incomplete() -> None:
    knee, t = course(70.0, 70.0, 70.0)
    part = slice(200, 1000)
    repetitions = find_repetitions(knee[part], t[part], "left")
    assert [r.excluded for r in repetitions] == ["incomplete", None, "incomplete"]


def test_a_silence_and_a_moving_foot_exclude() -> None:
    knee, t = course(70.0, 70.0, 70.0)
    knee[530:560] = np.nan
    foot = np.zeros(len(t))
    foot[900:1100] = radians(40.0)
    assert [r.excluded for r in find_repetitions(knee, t, "right", foot)] == [
        None,
        "signal_lost",
        "foot_moved",
    ]
    assert find_repetitions(np.full(len(t), np.nan), t, "right") == ()
    with pytest.raises(ParameterError):
        RepetitionParams(edge=0.6)


def test_a_bend_of_a_lifted_leg_is_no_squat_of_it() -> None:
    knee, t = course(70.0, 70.0, 70.0)
    stands = (t < 4.2) | (t > 7.8)
    repetitions = find_repetitions(knee, t, "right", stands=stands)
    assert [r.excluded for r in repetitions] == [None, "foot_lifted", None]
    _, _, leg, angles = squatted("right")
    hanging = replace(leg, stands=np.zeros(len(angles.t_s), bool))
    side = measure_squats(angles, hanging, "right")
    assert {p.reason for p in side.parameters} == {"no_repetitions"}
    assert {r.excluded for r in side.repetitions} == {"foot_lifted"}
    with pytest.raises(ParameterError):
        RepetitionParams(lifted=0.0)
