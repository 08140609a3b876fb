"""The sensitivity analysis on simulated squats, whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import radians

import numpy as np
import pytest

from sagittal.core.body.chain.leg import estimate_leg
from sagittal.core.calibration.fixed_offset import make_fixed_mounts
from sagittal.core.calibration.known_mounts import FIXED_OFFSET, calibrate_with_mounts
from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import SIDES
from sagittal.core.rotation import about, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.simulate import RecordingSetup, Squats, simulate_squats
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.squat_chain import measure_leg, place_as_agreed
from sagittal.core.simulate.truth import joint_angles
from sagittal.core.squat.joints import JOINTS, name_joint_angles
from sagittal.core.squat.sensitivity import (
    PARAMETERS,
    ReferenceAngles,
    SensitivityTable,
    SquatCase,
    analyse_legs,
    analyse_sensitivity,
    average_sensitivity,
    make_case,
)
from sagittal.core.timeline import synchronise
from tests.core.body.chain.squats import HEIGHT_M, squat_on


@cache
def case() -> SquatCase:
    """Two squats with noise, every sensor exactly as agreed."""
    simulation = squat_on("right", 50.0, RecordingSetup().noise, repetitions=2)
    calibrated = calibrate_with_mounts(
        synchronise(simulation.recording), make_fixed_mounts("right"), "fixed_offset", FIXED_OFFSET
    )
    leg = measure_leg(HEIGHT_M, "right")
    truth = ReferenceAngles(simulation.truth.t_s, simulation.truth.angles)
    return make_case(calibrated, leg, truth, from_standing=False)


@cache
def table() -> SensitivityTable:
    return analyse_sensitivity(case())


@pytest.mark.slow
def test_the_24_parameters_of_the_paper() -> None:
    assert len(PARAMETERS) == 24
    assert tuple(row.name for row in table().rows) == PARAMETERS
    assert np.degrees(table().errors[:6]).max() < 1.0


@pytest.mark.slow
def test_nothing_is_five_percent_off_zero() -> None:
    zero = {
        "Zr3S",
        "Yr3",
        "Zr3",
        "Zr4S",
        "Yr4",
        "Zr4",
        *(n for n in PARAMETERS if n[-4:] in ("-tib", "-thi", "-bac")),
    }
    zero.discard("Roll-tib")
    rows = {row.name: row for row in table().rows}
    for name in PARAMETERS:
        row = rows[name]
        assert (row.reason == "parameter_nominal_zero") == (name in zero), name
        assert (row.relative_rad is None) == (row.sensitivity_pct is None) == (name in zero), name
        assert np.isfinite(row.absolute_rad).all()
    assert rows["Roll-tib"].nominal == pytest.approx(radians(45.0))


@pytest.mark.slow
def test_what_is_above_does_not_move_what_is_below() -> None:
    for row in table().rows:
        if row.name.endswith("-thi") or row.name in ("LThi2Knee", "CThi"):
            assert row.absolute_rad[:3] == pytest.approx(0.0)
        if row.name.endswith("-bac") or row.name in ("PW", "PD", "LL", "Lthigh"):
            assert row.absolute_rad[:4] == pytest.approx(0.0)


def test_a_change_is_that_of_equation_1() -> None:
    """The figure of one parameter, worked out by hand from three runs."""
    row = next(r for r in table().rows if r.name == "Roll-tib")
    turn = 0.05 * radians(45.0)
    mount = case().mounts["shank_r"]
    errors = []
    for by_key in (turn, -turn):
        off = replace(case(), mounts={**case().mounts, "shank_r": to_matrix(about(1, by_key)) @ mount})
        errors.append(analyse_errors(off))
    change = np.mean(np.abs(np.array(errors) - table().errors), axis=0)
    assert row.relative_rad == pytest.approx(change)
    reference = table().errors > radians(0.1)
    assert row.sensitivity_pct is not None
    assert row.sensitivity_pct[reference] == pytest.approx(
        100.0 * change[reference] / table().errors[reference] / 0.05
    )
    assert np.isnan(row.sensitivity_pct[~reference]).all()


def analyse_errors(off: SquatCase) -> np.ndarray:
    from sagittal.core.squat.sensitivity import _run

    return _run(off, off.geometry, off.mounts, None)


def test_from_standing_a_turned_sensor_costs_little() -> None:
    rolled = {**case().mounts, "thigh_r": to_matrix(about(2, radians(5.0))) @ case().mounts["thigh_r"]}
    off = replace(case(), mounts=rolled)
    assert np.degrees(analyse_errors(off)[3]) > 4.5
    standing = slice(0, 100)
    zeroed = {name: a - a[standing].mean() for name, a in case().reference.items()}
    assert np.degrees(analyse_errors(replace(off, zero=standing, reference=zeroed))[3]) < 0.5


def test_joint_angles_are_those_of_the_orientations() -> None:
    simulation = squat_on("left", 50.0, repetitions=1)
    calibrated = calibrate_with_mounts(
        synchronise(simulation.recording), make_fixed_mounts("left"), "fixed_offset", FIXED_OFFSET
    )
    leg = estimate_leg(calibrated, measure_leg(HEIGHT_M, "left"))
    named = name_joint_angles(leg.motion.angles, "left")
    expected = joint_angles(leg.orientations.q)
    assert len(named) == len(JOINTS)
    for name, values in named.items():
        assert values == pytest.approx(expected[name][leg.first :], abs=1e-9), name


def test_averages_leave_out_what_is_not_defined() -> None:
    rows = [np.full(7, 2.0), None, np.array([4.0, np.nan, 4.0, 4.0, 4.0, 4.0, np.nan])]
    assert average_sensitivity(rows).tolist() == [3.0, 2.0, 3.0, 3.0, 3.0, 3.0, 2.0]
    assert np.isnan(average_sensitivity([None])).all()


def test_a_reference_that_does_not_fit_is_refused() -> None:
    simulation = squat_on("right", 50.0, repetitions=1)
    calibrated = calibrate_with_mounts(
        synchronise(simulation.recording), make_fixed_mounts("right"), "fixed_offset", FIXED_OFFSET
    )
    leg, truth = measure_leg(HEIGHT_M, "right"), simulation.truth
    with pytest.raises(EstimationError) as caught:
        make_case(
            calibrated, leg, ReferenceAngles(truth.t_s, {"knee_flexion_r": truth.t_s}), from_standing=False
        )
    assert caught.value.code == "no_reference"
    with pytest.raises(EstimationError) as caught:
        make_case(calibrated, leg, ReferenceAngles(truth.t_s + 1e4, truth.angles), from_standing=False)
    assert caught.value.code == "no_reference"
    with pytest.raises(ParameterError):
        analyse_sensitivity(case(), relative=0.0)


@cache
def both_legs() -> CalibratedRecording:
    squats = Squats(repetitions=1, other="lifted", hinged=True)
    setup = RecordingSetup(rate_hz=50.0, noise=MEMS)
    result = simulate_squats(squats, HEIGHT_M, 0, setup, place_as_agreed(HEIGHT_M, SIDES))
    return calibrate_with_mounts(
        synchronise(result.recording), make_fixed_mounts(*SIDES), "fixed_offset", FIXED_OFFSET
    )


@pytest.mark.sweep
def test_without_a_reference_errors_are_changes_of_the_legs_own_angles() -> None:
    legs = [measure_leg(HEIGHT_M, side) for side in SIDES]
    values: list[float] = []
    result = analyse_legs(
        both_legs(), legs, from_standing=False, progress=lambda _, share: values.append(share)
    )
    assert set(result) == {"left", "right"}
    assert values == sorted(values)
    assert len(values) == 48
    for leg in result.values():
        rows = {row.name: row for row in leg.rows}
        assert not leg.errors.any()
        assert np.degrees(rows["Yaw-thi"].absolute_rad[3]) == pytest.approx(2.0, abs=0.3)
        roll = rows["Roll-tib"]
        assert roll.sensitivity_pct is not None
        assert np.isnan(roll.sensitivity_pct).all()
        assert roll.relative_rad is not None
        assert np.degrees(roll.relative_rad.max()) > 0.3


def test_changes_are_of_the_samples_in_which_the_foot_stands() -> None:
    leg = make_case(both_legs(), measure_leg(HEIGHT_M, "left"), None, from_standing=True)
    assert 0.3 < leg.counted.mean() < 0.8
    assert not analyse_errors(leg).any()


@pytest.mark.slow
def test_a_reference_of_one_leg_judges_that_leg() -> None:
    legs = [measure_leg(HEIGHT_M, side) for side in SIDES]
    t_s = both_legs().recording.t_s
    right = ReferenceAngles(t_s, {f"{joint}_r": np.zeros(len(t_s)) for joint in JOINTS})
    assert set(analyse_legs(both_legs(), legs, right, from_standing=True)) == {"right"}
    with pytest.raises(EstimationError) as caught:
        analyse_legs(both_legs(), legs, ReferenceAngles(t_s, {}), from_standing=True)
    assert caught.value.code == "no_reference"
