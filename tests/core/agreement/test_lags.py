"""Clock offsets: estimated size, correction by sample times, no false alarm on a clean walk."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement import Agreement, AgreementParams, check_agreement
from sagittal.core.agreement.agree import compare_sensors
from sagittal.core.agreement.lags import find_drifts, find_sensor_lags
from sagittal.core.agreement.params import JointParams, LagParams
from sagittal.core.agreement.windows import JointWindows, compare_at_joint
from sagittal.core.frames import Segment
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.perturbations import delay_sensor
from tests.helpers.walks import only, simulated

LEG: tuple[Segment, ...] = ("pelvis", "thigh_l", "thigh_r", "shank_r", "foot_r")


@cache
def walk() -> UniformRecording:
    return only(simulated("comfortable", 1)[0], *LEG)


@cache
def clean() -> Agreement:
    return check_agreement(walk())


def codes(result: Agreement) -> list[str]:
    return [n.code for n in result.recording.notices if n not in walk().notices]


def test_a_clean_walk_is_the_same_recording() -> None:
    assert clean().recording is walk()
    assert clean().lags == ()
    assert clean().drifts == ()


@pytest.mark.slow
@pytest.mark.parametrize(("segment", "late_s"), [("shank_r", 0.04), ("foot_r", -0.1), ("pelvis", 0.033)])
def test_a_late_sensor_is_told_and_laid_where_it_belongs(segment: Segment, late_s: float) -> None:
    agreement = check_agreement(delay_sensor(walk(), segment, late_s))
    assert [x.sensors for x in agreement.lags] == [(segment,)]
    assert agreement.lags[0].lag_s == pytest.approx(late_s, abs=0.004)
    assert codes(agreement) == ["sensor_late"]
    assert agreement.recording.notices[-1].severity == "warning"
    assert f"{1000 * abs(agreement.lags[0].lag_s):.0f} ±" in agreement.recording.notices[-1].message
    inside = slice(100, -100)
    truth, repaired = (r.sensors[segment].gyr[inside] for r in (walk(), agreement.recording))
    late = delay_sensor(walk(), segment, late_s).sensors[segment].gyr[inside]
    assert np.abs(repaired - truth).mean() < 0.25 * np.abs(late - truth).mean()


def test_a_small_lag_is_repaired_and_only_noted() -> None:
    agreement = check_agreement(delay_sensor(walk(), "shank_r", 0.02))
    assert codes(agreement) == ["sensor_late"]
    assert agreement.recording.notices[-1].severity == "info"


def test_a_lag_below_the_limit_is_not_told() -> None:
    assert codes(check_agreement(delay_sensor(walk(), "shank_r", 0.008))) == []


def test_the_repair_can_be_undone() -> None:
    late = delay_sensor(walk(), "shank_r", 0.04)
    agreement = check_agreement(late, AgreementParams(lags=LagParams(repair=False)))
    assert codes(agreement) == ["sensor_late"]
    assert agreement.recording.sensors["shank_r"] is late.sensors["shank_r"]


def test_a_thigh_that_a_hip_alone_accuses_is_told_from_thirty_ms_and_left() -> None:
    small, large = (delay_sensor(walk(), "thigh_l", x) for x in (0.022, 0.045))
    assert codes(check_agreement(small)) == []
    agreement = check_agreement(large)
    assert codes(agreement) == ["clocks_disagree"]
    assert agreement.recording.sensors["thigh_l"] is large.sensors["thigh_l"]


def test_of_two_sensors_nobody_knows_which_is_late() -> None:
    pair = only(walk(), "shank_r", "foot_r")
    assert codes(check_agreement(delay_sensor(pair, "foot_r", 0.02))) == []
    agreement = check_agreement(delay_sensor(pair, "foot_r", 0.05))
    assert codes(agreement) == ["clocks_disagree"]
    assert not agreement.lags[0].sure


def test_a_clock_that_runs_slow_is_stretched() -> None:
    growing = np.linspace(0.0, 0.06, len(walk().t_s))
    late = delay_sensor(walk(), "shank_r", growing)
    agreement = check_agreement(late)
    assert [d.sensor for d in agreement.drifts] == ["shank_r"]
    assert "clock_drifts" in codes(agreement)
    joints, _ = compare_sensors(agreement.recording, JointParams())
    assert find_drifts(joints, LagParams()) == ()
    assert find_sensor_lags(joints, LagParams()) == ()


def test_sensors_without_a_common_joint_say_nothing() -> None:
    apart = only(simulated("comfortable", 1)[0], "pelvis", "foot_l", "foot_r")
    assert check_agreement(apart).recording is apart


def test_a_window_with_lost_samples_is_left_out() -> None:
    x = walk().sensors["foot_r"]
    valid = x.valid.copy()
    valid[1000:1300] = False
    lossy = replace(walk(), sensors={**walk().sensors, "foot_r": replace(x, valid=valid)})
    joints, _ = compare_sensors(lossy, JointParams())
    ankle = next(w for w in joints if w.second == "foot_r")
    assert len(ankle.t_s)
    # one second of six may be missing, a window in the middle of the loss has three
    assert not np.any(np.abs(ankle.t_s - 11.5) < 1.5)
    assert check_agreement(lossy).lags == ()


def test_a_knee_lies_within_a_leg_of_its_sensors_and_a_sensor_fits_itself() -> None:
    joints, terms = compare_sensors(walk(), JointParams())
    knee = next(w for w in joints if w.second == "shank_r")
    assert isinstance(knee, JointWindows)
    apart = np.linalg.norm(np.median(knee.place_in("thigh_r"), axis=0))
    norm = np.linalg.norm(np.median(knee.place_in("shank_r"), axis=0))
    assert 0.05 < apart < 0.45
    assert 0.05 < norm < 0.45
    same = compare_at_joint(("thigh_r", "shank_r"), terms["thigh_r"], terms["thigh_r"], JointParams())
    assert np.abs(same.lag_s).max() < 1e-3
    assert same.residual.max() < 1e-2
