"""Slips: named with moment and angle, shanks turned back, the rest withheld; others untouched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.agreement import AgreementParams, check_agreement
from sagittal.core.agreement.params import SlipParams
from sagittal.core.agreement.repair import turn_back
from sagittal.core.agreement.slips import SensorSlip
from sagittal.core.agreement.strides import find_main_axis
from sagittal.core.angles.withheld import withhold_at_slips
from sagittal.core.frames import Floats, Segment
from sagittal.core.pipeline import resume
from sagittal.core.rotation import exp, rotate
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from tests.helpers.perturbations import find_middle, slip_sensor
from tests.helpers.walks import analysed, only, simulated

AT_S = 17.0


def walk() -> UniformRecording:
    simulation = simulated("comfortable", 1)[0]
    return only(simulation, *(s for s in simulation.sensors if s != "chest"))


@pytest.mark.slow
@pytest.mark.parametrize("segment", ["shank_r", "foot_l"])
def test_a_slip_is_named_with_its_moment_and_angle(segment: Segment) -> None:
    slipped = slip_sensor(walk(), segment, np.radians(15.0), AT_S)
    agreement = check_agreement(slipped)
    assert [x.segment for x in agreement.slips] == [segment]
    slip = agreement.slips[0]
    assert abs(slip.turn_rad) == pytest.approx(np.radians(15.0), abs=np.radians(2.0))
    assert slip.at_s == pytest.approx(AT_S, abs=2.5)
    assert [n.code for n in agreement.recording.notices] == ["sensor_slipped"]
    start, end = agreement.doubtful[segment]
    assert start < AT_S < end
    assert (end == np.inf) == (segment == "foot_l")
    lost = ~agreement.recording.sensors[segment].valid
    assert np.array_equal(lost, (slipped.t_s >= start) & (segment == "foot_l"))
    assert (agreement.whole is None) == (segment == "shank_r")


@pytest.mark.slow
def test_a_shank_is_turned_back_and_a_foot_is_left() -> None:
    slipped = slip_sensor(walk(), "shank_r", np.radians(15.0), AT_S)
    repaired = check_agreement(slipped).recording
    late = slice(round((AT_S + 4.0) * 100), -100)
    truth, bad, good = (r.sensors["shank_r"].acc[late] for r in (walk(), slipped, repaired))
    assert np.abs(good - truth).mean() < 0.2 * np.abs(bad - truth).mean()
    left = check_agreement(slipped, AgreementParams(slips=SlipParams(repair=False)))
    assert left.recording.sensors["shank_r"] is slipped.sensors["shank_r"]
    assert left.doubtful["shank_r"][1] == np.inf
    foot = slip_sensor(walk(), "foot_l", np.radians(15.0), AT_S)
    left = check_agreement(foot, AgreementParams(slips=SlipParams(repair=False)))
    assert left.recording.sensors["foot_l"] is foot.sensors["foot_l"]


def test_what_the_gyroscope_saw_of_a_slip_leaves_its_rate() -> None:
    """A sensor at rest that turns by 20° and is turned back never moved."""
    t_s = np.arange(500) / 100.0
    axis = np.array([0.0, 0.0, 1.0])
    angle = np.radians(20.0) * np.clip((t_s - 2.0) / 0.3, 0.0, 1.0)
    rate = np.zeros((500, 3))
    rate[200:230] = -np.radians(20.0) / 0.3 * axis
    acc: Floats = rotate(exp(angle[:, None] * axis), np.tile([9.81, 0.0, 0.0], (500, 1)))
    ok = np.ones(500, np.bool_)
    x = SensorSignals("a", acc, rate, None, ok, ~ok)
    slip = SensorSlip("shank_l", 2.0, 2.0, float(np.radians(20.0)), 0.01, (0.0, 0.0, 1.0))
    back = turn_back(x, t_s, slip)
    assert np.abs(back.gyr.sum(axis=0)).max() < 1e-9
    assert np.abs(back.acc[230:] - [9.81, 0.0, 0.0]).max() < 1e-9


@pytest.mark.sweep
@pytest.mark.parametrize(("segment", "by_deg"), [("thigh_l", 15.0), ("foot_l", 15.0), ("foot_l", -15.0)])
def test_no_figure_rests_on_what_a_slipped_sensor_measured(segment: Segment, by_deg: float) -> None:
    """Parameters reported despite a slip equal those without it, within their uncertainty."""
    right = analysed("healthy", 5)
    slipped = slip_sensor(right.recording, segment, np.radians(by_deg), find_middle(right.recording))
    resumed_run = resume(replace(right, uniform=slipped), "agreement")
    assert [n.code for n in resumed_run.notices if n.code in ("sensor_slipped", "gap")] == ["sensor_slipped"]
    truth = {(p.name, p.side): p.mean for p in right.parameters}
    wrong = [
        (p.name, p.side, truth[p.name, p.side], p.mean)
        for p in resumed_run.parameters
        if p.mean is not None
        and p.uncertainty is not None
        and (mean := truth[p.name, p.side]) is not None
        and abs(p.mean - mean) > p.uncertainty
    ]
    assert wrong == []


def test_a_turn_that_comes_back_is_no_slip() -> None:
    target = slip_sensor(walk(), "shank_r", np.radians(15.0), 14.0)
    assert check_agreement(slip_sensor(target, "shank_r", -np.radians(15.0), 19.0)).slips == ()


def test_the_main_axis_of_a_leg_is_what_it_turns_about() -> None:
    rng = np.random.default_rng(1)
    rate = np.outer(np.sin(np.arange(300.0)), [0.6, 0.0, 0.8]) + 0.01 * rng.normal(size=(300, 3))
    assert abs(find_main_axis(rate) @ [0.6, 0.0, 0.8]) > 0.999


def test_angles_beside_a_slipped_sensor_are_withheld_from_there_on() -> None:
    from sagittal.core.angles import JointAngles

    t_s = np.arange(100) / 10.0
    names = ("hip_flexion_l", "knee_flexion_l", "ankle_dorsiflexion_l", "knee_flexion_r")
    angles = JointAngles(
        t_s=t_s,
        angles={name: np.zeros(100) for name in names},
        zero_offset=dict.fromkeys(names, 0.0),
        diagnostics={},
        notices=(),
    )
    visible_angles = withhold_at_slips(angles, {"shank_l": (4.0, np.inf), "thigh_r": (2.0, 3.0)}).angles
    assert np.isfinite(visible_angles["hip_flexion_l"]).all()
    for name in ("knee_flexion_l", "ankle_dorsiflexion_l"):
        assert np.array_equal(np.isnan(visible_angles[name]), t_s >= 4.0)
    assert np.array_equal(np.isnan(visible_angles["knee_flexion_r"]), (t_s >= 2.0) & (t_s <= 3.0))
