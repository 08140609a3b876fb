"""Places of sensors and centres of joints from motion: on simulated skin, and where motion says nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.body import arms
from sagittal.core.body.arm_params import ArmParams
from sagittal.core.body.arms import MeasuredArms, measure_arms, report_ahead
from sagittal.core.body.erkf.headings import turn_forward_axes
from sagittal.core.body.model import BodyModel
from sagittal.core.body.places import joint_places, sensor_place
from sagittal.core.body.tree import PRESETS, person_tree
from sagittal.core.calibration import calibrate
from sagittal.core.frames import Floats, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, conjugate, multiply, rotate, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.simulate.gait.soft_tissue import SoftTissue, skin_motion
from tests.helpers.walks import simulated

WHOLE = PRESETS["lower_body7"]
BODY = BodyModel.from_height(1.75)


@cache
def walk() -> tuple[CalibratedRecording, Orientations]:
    calibrated = calibrate(simulated("comfortable", 3)[0])
    return calibrated, estimate_orientations(calibrated)


def true_arms(calibrated: CalibratedRecording) -> dict[tuple[Segment, Segment], tuple[Floats, Floats]]:
    """Joint → its mean place while walking from both sensors, in the calibrated axes of their segments, m."""
    truth = simulated("comfortable", 3)[1]
    walked = np.zeros(len(truth.t_s), bool)
    for a, b in calibrated.calibration.walking:
        walked |= (truth.t_s >= a) & (truth.t_s < b)
    result = {}
    for joint, centres in joint_places(truth.body).items():
        arms = []
        for segment, centre in zip(joint, centres, strict=True):
            mount, skin = truth.mounts[segment], skin_motion(truth.q, segment, SoftTissue())
            turn, shift = (np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)) if skin is None else skin
            q = multiply(turn, mount.q_segment_sensor)
            r = np.atleast_2d(rotate(conjugate(q), centre - mount.position_m - shift))
            r = np.broadcast_to(r, (len(walked), 3))[walked].mean(axis=0)
            arms.append(calibrated.calibration.segments[segment].R_segment_sensor @ r)
        result[joint] = (arms[0], arms[1])
    return result


def arms_of(
    centre: Floats, places: dict[Segment, Floats], joint: tuple[Segment, Segment]
) -> tuple[Floats, Floats]:
    return centre - places[joint[0]], -places[joint[1]]


def test_on_skin_arms_come_out_within_a_centimetre_of_the_truth() -> None:
    calibrated, orientations = walk()
    result = measure_arms(calibrated, orientations, BODY, WHOLE)
    guesses = {s: sensor_place(s, BODY) for s in WHOLE}
    initial, final, scores = [], [], []
    for joint, true in true_arms(calibrated).items():
        assert result.joints[joint].asked
        ours = arms_of(result.joints[joint].centre, result.places, joint)
        usual = arms_of(result.joints[joint].guess, guesses, joint)
        for k, segment in enumerate(joint):
            heard = result.sensors[segment].taken
            initial.append((usual[k] - true[k])[heard])
            final.append((ours[k] - true[k])[heard])
            scores.append(final[-1] / result.sensors[segment].sd[heard])
    rms = [float(np.sqrt(np.mean(np.concatenate(x) ** 2))) for x in (initial, final)]
    assert rms[0] > 0.02
    assert rms[1] < 0.01
    # what is said of its own uncertainty holds
    assert np.sqrt(np.mean(np.concatenate(scores) ** 2)) < 1.5


def test_the_place_across_a_thigh_stays_the_usual_one() -> None:
    result = measure_arms(*walk(), BODY, WHOLE)
    for segment in ("thigh_l", "thigh_r"):
        sensor = result.sensors[segment]
        assert sensor.taken.tolist() == [True, True, False]
        assert sensor.place[2] == sensor.guess[2]
        assert sensor.sd[2] == ArmParams().place_sd["thigh"][2]


@pytest.mark.parametrize("turn_deg", [30.0, -30.0])
def test_forward_axes_that_are_all_turned_alike_are_told_and_keep_the_arms(turn_deg: float) -> None:
    """No joint sees it; that sensors then seem to sit beside their places does."""
    turned = turn_forward_axes(*walk(), {s: float(np.radians(turn_deg)) for s in WHOLE})
    straight, result = measure_arms(*walk(), BODY, WHOLE), measure_arms(*turned, BODY, WHOLE)
    assert report_ahead(straight) == ()
    (notice,) = report_ahead(result)
    assert notice.code == "forward_against_places"
    assert f"to the {'right' if turn_deg > 0.0 else 'left'}" in notice.message
    assert abs(np.degrees(result.ahead) - turn_deg) < 10.0
    back = to_matrix(about(1, -np.radians(turn_deg)))
    off = [np.linalg.norm(back @ result.places[s] - straight.places[s]) for s in ("foot_r", "foot_l")]
    assert max(off) < 0.02


def test_legs_end_side_by_side_as_far_as_motion_lets_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """One leg that ends ahead of the other makes steps uneven; people stand with their feet side by side."""

    def ahead_of(body_arms: MeasuredArms) -> float:
        centres = body_arms.centres
        return float(sum(c[0] if joint[1].endswith("_r") else -c[0] for joint, c in centres.items()))

    neighbour = ahead_of(measure_arms(*walk(), BODY, WHOLE))
    monkeypatch.setattr(arms, "BESIDE_SD_M", 10.0)
    anywhere = ahead_of(measure_arms(*walk(), BODY, WHOLE))
    assert abs(neighbour) < 0.75 * abs(anywhere)
    monkeypatch.setattr(arms, "BESIDE_SD_M", 1e-4)
    assert abs(ahead_of(measure_arms(*walk(), BODY, WHOLE))) < 1e-3


def assert_as_usual(result: MeasuredArms) -> None:
    for sensor in result.sensors.values():
        np.testing.assert_array_equal(sensor.place, sensor.guess)
        assert not sensor.taken.any()
    for joint in result.joints.values():
        np.testing.assert_allclose(joint.centre, joint.guess, atol=1e-12)
        assert not joint.asked


def test_where_nobody_walked_everything_is_as_usual() -> None:
    calibrated, orientations = walk()
    stood = replace(calibrated, calibration=replace(calibrated.calibration, walking=((0.0, 2.0),)))
    assert_as_usual(measure_arms(stood, orientations, BODY, WHOLE))
    nowhere = replace(calibrated, calibration=replace(calibrated.calibration, walking=()))
    assert_as_usual(measure_arms(nowhere, orientations, BODY, WHOLE))


def test_sensors_without_a_joint_between_them_say_nothing() -> None:
    result = measure_arms(*walk(), BODY, PRESETS["feet_pelvis3"])
    assert result.joints == {}
    assert_as_usual(result)


def test_a_joint_that_does_not_hold_together_is_not_heard() -> None:
    calibrated, orientations = walk()
    sensors = dict(calibrated.recording.sensors)
    late = sensors["foot_l"]
    sensors["foot_l"] = replace(late, acc=np.roll(late.acc, 40, axis=0), gyr=np.roll(late.gyr, 40, axis=0))
    wrong = replace(calibrated, recording=replace(calibrated.recording, sensors=sensors))
    result = measure_arms(wrong, orientations, BODY, WHOLE)
    ankle = result.joints["shank_l", "foot_l"]
    assert ankle.misfit is not None
    assert ankle.misfit > ArmParams().worst_misfit
    assert not ankle.asked
    np.testing.assert_array_equal(result.places["foot_l"], sensor_place("foot_l", BODY))
    assert result.joints["shank_r", "foot_r"].asked


def test_the_tree_has_the_measured_arms() -> None:
    calibrated, orientations = walk()
    result = measure_arms(calibrated, orientations, BODY, WHOLE)
    mounts = {s: calibrated.calibration.segments[s].R_segment_sensor for s in WHOLE}
    tree = person_tree(BODY, mounts, WHOLE, result.places, result.centres)
    for joint in tree.joints:
        pair = (WHOLE[joint.proximal], WHOLE[joint.distal])
        near, far = arms_of(result.centres[pair], result.places, pair)
        np.testing.assert_allclose(mounts[pair[0]] @ joint.r_proximal, near, atol=1e-12)
        np.testing.assert_allclose(mounts[pair[1]] @ joint.r_distal, far, atol=1e-12)


@pytest.mark.parametrize("part", [slice(0, 3), slice(3, 7)])
def test_any_part_of_the_body_may_be_worn(part: slice) -> None:
    result = measure_arms(*walk(), BODY, WHOLE[part])
    assert set(result.sensors) == set(WHOLE[part])
    assert all(set(joint) <= set(WHOLE[part]) for joint in result.joints)
