"""The figure: rigid, on the floor, smooth, and as far as the person walked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.body import BodyModel, contact_mask, forward_kinematics, nominal_body
from sagittal.core.body.kinematics import sole_points
from sagittal.core.body.poses import Poses
from sagittal.core.calibration import calibrate
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Side
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import rotate
from sagittal.core.simulate import WalkTruth
from tests.helpers.walks import only, simulated

BODY = BodyModel.from_height(1.75)


def true_contacts(truth: WalkTruth, t_s: np.ndarray) -> dict[Side, Bools]:
    return {
        s: contact_mask(t_s, truth.contacts[s].contact.tolist(), truth.contacts[s].release.tolist())
        for s in SIDES
    }


def from_truth(truth: WalkTruth) -> Orientations:
    valid = {s: np.ones(len(truth.t_s), bool) for s in truth.q}
    return Orientations(truth.t_s, truth.rate_hz, truth.q, valid, "truth")


def figure(name: str = "comfortable") -> tuple[Poses, WalkTruth]:
    _, truth = simulated(name)
    return forward_kinematics(from_truth(truth), truth.body, true_contacts(truth, truth.t_s)), truth


def test_lengths_follow_height_and_are_marked_estimated() -> None:
    assert BODY.estimated
    assert BODY.thigh == pytest.approx(0.245 * 1.75)
    assert BODY.hip_width == pytest.approx(0.11 * 1.75)
    body, notices = nominal_body(None)
    assert body.thigh == pytest.approx(0.245 * 1.70)
    assert [n.code for n in notices] == ["height_assumed"]
    assert nominal_body(1.75) == (BODY, ())


def test_segments_keep_their_lengths_and_joints_hold_together() -> None:
    poses, truth = figure()
    body = truth.body
    for side in SIDES:
        hip, knee, ankle = (poses.p[x] for x in (THIGH[side], SHANK[side], FOOT[side]))
        np.testing.assert_allclose(np.linalg.norm(knee - hip, axis=1), body.thigh, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(ankle - knee, axis=1), body.shank, atol=1e-9)
        end = poses.p[THIGH[side]] + rotate(poses.q[THIGH[side]], np.array([0.0, -body.thigh, 0.0]))
        np.testing.assert_allclose(end, knee, atol=1e-9)
    width = np.linalg.norm(poses.p["thigh_r"] - poses.p["thigh_l"], axis=1)
    np.testing.assert_allclose(width, body.hip_width, atol=1e-9)


def test_the_figure_walks_as_far_as_the_person() -> None:
    poses, truth = figure()
    ours, true = poses.p["pelvis"], truth.p["pelvis"]
    travelled = float(np.linalg.norm((ours[-1] - ours[0])[:2]))
    walked = float(np.linalg.norm((true[-1] - true[0])[:2]))
    assert walked > 20.0
    assert travelled == pytest.approx(walked, rel=0.05)
    assert ours[-1, 0] > 0.9 * walked, "forward is x"


def test_the_figure_moves_smoothly_and_never_jumps() -> None:
    poses, truth = figure()
    speed = np.linalg.norm(np.diff(poses.p["pelvis"], axis=0), axis=1) * truth.rate_hz
    assert speed.max() < 3.0
    assert np.abs(np.diff(speed)).max() * truth.rate_hz < 40.0
    for foot in ("foot_l", "foot_r"):
        step = np.linalg.norm(np.diff(poses.p[foot], axis=0), axis=1)
        assert step.max() < 0.08


def test_the_figure_stands_on_the_floor() -> None:
    poses, truth = figure()
    soles = np.stack(
        [
            poses.p[FOOT[side]] + rotate(poses.q[FOOT[side]], np.array(point))
            for side in SIDES
            for point in sole_points(truth.body)
        ]
    )
    lowest = soles[..., 2].min(axis=0)
    assert abs(float(np.median(lowest))) < 0.01
    assert lowest.min() > -0.05
    assert np.abs(lowest).max() < 0.06


def test_a_foot_on_the_floor_does_not_slide() -> None:
    poses, truth = figure()
    for side in SIDES:
        single = poses.contact[FOOT[side]] & truth.flat[side] & ~poses.contact[FOOT[_other(side)]]
        v = np.linalg.norm(np.diff(poses.p[FOOT[side]][:, :2], axis=0), axis=1) * truth.rate_hz
        assert np.median(v[single[1:]]) < 0.05


def _other(side: Side) -> Side:
    return "left" if side == "right" else "right"


def test_without_contacts_the_lower_foot_carries() -> None:
    """A makeshift that falls short by a sixth: the swinging foot skims the floor and carries now and then."""
    _, truth = simulated("comfortable")
    poses = forward_kinematics(from_truth(truth), truth.body)
    walked = float(np.linalg.norm((truth.p["pelvis"][-1] - truth.p["pelvis"][0])[:2]))
    assert float(np.linalg.norm(poses.p["pelvis"][-1, :2])) == pytest.approx(walked, rel=0.2)


def test_from_sensors_to_a_figure_on_a_simulated_walk() -> None:
    recording, truth = simulated("comfortable")
    poses = forward_kinematics(
        estimate_orientations(calibrate(recording)), truth.body, true_contacts(truth, recording.t_s)
    )
    walked = float(np.linalg.norm((truth.p["pelvis"][-1] - truth.p["pelvis"][0])[:2]))
    assert float(np.linalg.norm(poses.p["pelvis"][-1, :2])) == pytest.approx(walked, rel=0.06)
    assert poses.valid.all()
    assert poses.method == "stance_foot_anchor"


def test_a_missing_segment_leaves_its_leg_out_with_a_reason() -> None:
    recording, _ = simulated("comfortable")
    retained = only(recording, "pelvis", "thigh_l", "shank_l", "foot_l", "thigh_r", "foot_r")
    poses = forward_kinematics(estimate_orientations(calibrate(retained)), BODY)
    assert set(poses.p) == {"pelvis", "thigh_l", "shank_l", "foot_l"}
    assert [n.code for n in poses.notices] == ["figure_incomplete"]
    assert "shank_r" in poses.notices[0].message
    assert np.isfinite(poses.p["pelvis"]).all()


def test_one_leg_alone_still_walks_forward() -> None:
    _, truth = simulated("comfortable")
    orientations = from_truth(truth)
    left = {s: x for s, x in orientations.q.items() if not s.endswith("_r")}
    contacts: dict[Side, Bools] = {"left": true_contacts(truth, truth.t_s)["left"]}
    poses = forward_kinematics(replace(orientations, q=left), truth.body, contacts)
    walked = float(np.linalg.norm((truth.p["pelvis"][-1] - truth.p["pelvis"][0])[:2]))
    assert float(np.linalg.norm(poses.p["pelvis"][-1, :2])) == pytest.approx(walked, rel=0.2)


def test_feet_alone_make_no_figure_but_a_reason() -> None:
    recording, _ = simulated("comfortable")
    poses = forward_kinematics(estimate_orientations(calibrate(only(recording, "foot_l", "foot_r"))), BODY)
    assert poses.p == {}
    assert poses.method == "none"
    assert "figure_incomplete" in {n.code for n in poses.notices}
