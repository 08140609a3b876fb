"""Which estimator a take gets, what is done when a sensor failed, and what comes out of each."""

from __future__ import annotations

import weakref
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core import calibration, events
from sagittal.core.angles.measure import measure_angles
from sagittal.core.body import contact_mask
from sagittal.core.body.choice import list_possible_estimators
from sagittal.core.body.estimate import PoseEstimate, estimate_poses
from sagittal.core.body.mounting import MountedSensors, mount_sensors
from sagittal.core.body.pose_params import PoseParams
from sagittal.core.body.tree import PRESETS
from sagittal.core.errors import EstimationError
from sagittal.core.frames import FOOT, SEGMENTS, SIDES, Floats, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import LastReading
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import WalkTruth
from tests.helpers.walks import only, simulated

WHOLE = PRESETS["lower_body7"]
PELVIS_FEET = PRESETS["feet_pelvis3"]
FEET = PRESETS["feet2"]


def mounted(take: UniformRecording, params: PoseParams) -> MountedSensors:
    calibrated = calibration.calibrate(take)
    return mount_sensors(calibrated, estimate_orientations(calibrated), params)


def estimated(take: UniformRecording, params: PoseParams | None = None) -> PoseEstimate:
    params = params or PoseParams()
    detections = events.detect(estimate_orientations(calibration.calibrate(take)))
    contacts = {
        s: contact_mask(take.t_s, detections.times(s, "ic"), detections.times(s, "tc")) for s in SIDES
    }
    return estimate_poses(mounted(take, params), contacts, params)


@cache
def walk(*worn: Segment) -> PoseEstimate:
    return estimated(only(simulated("fast_with_turns", 3)[0], *(worn or WHOLE)))


def truth() -> WalkTruth:
    return simulated("fast_with_turns", 3)[1]


def failing(take: UniformRecording, segment: Segment, from_s: float) -> UniformRecording:
    """The take with one sensor that stops at a time."""
    was = take.sensors[segment]
    valid = was.valid & (take.t_s < from_s)
    return replace(take, sensors={**take.sensors, segment: replace(was, valid=valid)})


@pytest.mark.parametrize(
    ("worn", "first"),
    [
        (WHOLE, "erkf"),
        (PELVIS_FEET, "l7s_3i"),
        (FEET, "l7s_2i"),
        (set(WHOLE) - {"thigh_l"}, "l7s_3i"),
        (set(WHOLE) - {"pelvis"}, "l7s_2i"),
        (set(WHOLE) - {"foot_l"}, "erkf"),
        (("pelvis", "thigh_r", "shank_r", "foot_r"), "erkf"),
        (("foot_l",), None),
        ((), None),
    ],
)
def test_what_is_worn_decides(worn: set[Segment], first: str | None) -> None:
    assert (list_possible_estimators(worn) or (None,))[0] == first


@pytest.mark.sweep
def test_seven_sensors_walk_through_the_room_as_the_person_did() -> None:
    result = walk()
    assert result.poses.method == "erkf_smoothed"
    assert result.poses.reduced is None
    assert result.orientations.engine == "erkf_smoothed"
    n = min(len(result.poses.t_s), len(truth().t_s))
    path, true = result.poses.p["pelvis"][:n, :2], truth().p["pelvis"][:n, :2]
    # a common heading is free: the two paths are laid on each other before they are compared
    apart = _after_turning(path - path[0], true - true[0])
    assert np.abs(apart).max() < 0.6
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(
        np.linalg.norm(np.diff(true, axis=0), axis=1).sum(), rel=0.02
    )


@pytest.mark.sweep
def test_the_floor_stays_at_zero_and_segments_hang_together() -> None:
    poses = walk().poses
    for side in SIDES:
        still = walk().feet.still[side]  # type: ignore[union-attr]
        height = poses.p[FOOT[side]][still, 2] - poses.body.ankle_height
        assert np.abs(height).max() < 0.03
    knee = poses.p["thigh_r"] + _down(poses.q["thigh_r"], poses.body.thigh)
    assert np.sqrt(np.mean(np.sum((knee - poses.p["shank_r"]) ** 2, axis=1))) < 0.01


@pytest.mark.sweep
def test_feet_are_linked_only_by_a_whole_chain() -> None:
    assert walk().feet is not None
    assert walk().feet.linked  # type: ignore[union-attr]
    for segments in (PELVIS_FEET, FEET):
        feet = walk(*segments).feet
        assert feet is not None
        assert not feet.linked
        assert feet.source == "erkf_feet"
    one = walk("foot_l").feet
    assert one is not None
    assert set(one.p) == {"left"}
    assert walk("pelvis", "thigh_r", "shank_r").feet is None


@pytest.mark.sweep
@pytest.mark.parametrize(("worn", "method"), [(PELVIS_FEET, "l7s_3i"), (FEET, "l7s_2i")])
def test_few_sensors_give_a_figure_and_all_angles_named_as_estimated(
    worn: tuple[Segment, ...], method: str
) -> None:
    result = walk(*worn)
    assert result.poses.method == method
    assert set(result.poses.q) == set(WHOLE)
    zero = calibration.calibrate(only(simulated("fast_with_turns", 3)[0], *worn)).calibration.zero
    angles = measure_angles(result.orientations, zero, result.poses)
    assert len(angles.angles) == 20
    estimated_names = set(angles.diagnostics["estimated"])  # type: ignore[call-overload]
    assert {n for n in angles.angles if not n.startswith("pelvis")} <= estimated_names
    assert ("pelvis_tilt" in estimated_names) == (method == "l7s_2i")


@pytest.mark.sweep
def test_a_failed_thigh_leaves_the_other_leg_as_measured_and_estimates_the_rest() -> None:
    take = failing(simulated("fast_with_turns", 3)[0], "thigh_l", 15.0)
    estimate = estimated(take)
    assert estimate.poses.method == "l7s_3i"
    assert estimate.poses.reduced == "sensor_failed"
    (notices,) = [n for n in estimate.poses.notices if n.code == "sensor_failed"]
    assert notices.sensor == "thigh_l"
    assert "50%" in notices.message
    zero = calibration.calibrate(take).calibration.zero
    angles = measure_angles(estimate.orientations, zero, estimate.poses)
    names = {n.rpartition("_") for n in angles.diagnostics["estimated"]}  # type: ignore[attr-defined]
    assert {(base.split("_")[0], side) for base, _, side in names} == {("hip", "l"), ("knee", "l")}


@pytest.mark.sweep
def test_a_failed_foot_leaves_one_leg_with_the_pelvis() -> None:
    estimate = estimated(failing(simulated("fast_with_turns", 3)[0], "foot_l", 15.0))
    assert estimate.poses.method == "erkf_smoothed"
    assert set(estimate.poses.q) == {"pelvis", "thigh_r", "shank_r", "foot_r"}
    assert estimate.feet is not None
    assert set(estimate.feet.p) == {"right"}
    assert {n.code for n in estimate.poses.notices} >= {"sensor_failed", "figure_incomplete"}


@pytest.mark.sweep
def test_a_short_loss_is_no_failure() -> None:
    take = simulated("lost_sensor", 41)[0]
    estimate = estimated(take)
    assert estimate.poses.method == "erkf_smoothed"
    assert estimate.poses.reduced is None


@pytest.mark.sweep
def test_another_estimator_runs_on_the_same_take() -> None:
    take = simulated("fast_with_turns", 3)[0]
    for name, method in (("l7s_3i", "l7s_3i"), ("stance_foot_anchor", "stance_foot_anchor")):
        estimate = estimated(take, PoseParams(estimator=name))  # type: ignore[arg-type]
        assert estimate.poses.method == method
        assert estimate.poses.diagnostics["requested"] == name
        assert estimate.feet is not None


def test_an_estimator_that_lacks_its_sensors_says_which_it_needs() -> None:
    with pytest.raises(EstimationError, match="requires sensors on the pelvis and both feet") as caught:
        estimated(only(simulated("fast_with_turns", 3)[0], *FEET), PoseParams(estimator="l7s_3i"))
    assert caught.value.code == "estimator_impossible"


@pytest.mark.sweep
def test_an_unasked_estimator_that_fails_gives_way_to_the_next() -> None:
    sensors = mounted(simulated("fast_with_turns", 3)[0], PoseParams())
    broken = replace(sensors, body=replace(sensors.body, thigh=-0.4))
    result = estimate_poses(broken, {}, PoseParams())
    assert result.poses.reduced == "estimator_failed"
    assert [n.code for n in result.poses.notices].count("estimator_failed") >= 1
    assert "thigh" in result.poses.notices[0].message
    assert result.feet is None
    assert "foot_paths_failed" in {n.code for n in result.poses.notices}


@pytest.mark.sweep
def test_without_an_answer_of_the_joints_the_next_estimator_is_used() -> None:
    sensors = mounted(only(simulated("fast_with_turns", 3)[0], *WHOLE), PoseParams())
    assert set(sensors.turned_rad) == set(WHOLE)
    failed = replace(sensors, failure=EstimationError("filter_diverged", "It diverged."))
    result = estimate_poses(failed, {}, PoseParams())
    assert result.poses.reduced == "estimator_failed"
    assert result.poses.method == "l7s_3i"
    assert "erkf cannot estimate this take" in result.poses.notices[0].message


def handed_on(sensors: MountedSensors) -> tuple[MountedSensors, dict[Segment, weakref.ref[Floats]]]:
    """The same with orientations for their last reader, and who of them is still there."""
    passed = LastReading({s: q.copy() for s, q in sensors.orientations.q.items()})
    watched = {s: weakref.ref(q) for s, q in passed.items()}
    return replace(sensors, orientations=replace(sensors.orientations, q=passed)), watched


@pytest.mark.sweep
def test_the_erkf_lets_go_of_orientations_that_nobody_else_reads_and_finds_the_same() -> None:
    sensors = mounted(only(simulated("fast_with_turns", 3)[0], *WHOLE), PoseParams())
    handed, watched = handed_on(sensors)
    result, whole = (estimate_poses(x, {}, PoseParams()) for x in (handed, sensors))
    assert [s for s, target in watched.items() if target() is not None] == []
    assert list(result.orientations.q) == list(whole.orientations.q)
    for s, q in whole.orientations.q.items():
        np.testing.assert_array_equal(result.orientations.q[s], q)
    for s, p in whole.poses.p.items():
        np.testing.assert_array_equal(result.poses.p[s], p)


@pytest.mark.sweep
def test_where_the_erkf_fails_the_next_estimator_still_reads_the_orientations() -> None:
    sensors = mounted(only(simulated("fast_with_turns", 3)[0], *WHOLE), PoseParams())
    handed, watched = handed_on(replace(sensors, failure=EstimationError("filter_diverged", "It diverged.")))
    result = estimate_poses(handed, {}, PoseParams())
    assert result.poses.method == "l7s_3i"
    assert all(target() is not None for target in watched.values())


def test_only_where_the_erkf_runs_forward_axes_are_turned_by_the_joints() -> None:
    take = simulated("fast_with_turns", 3)[0]
    for params in (PoseParams(estimator="l7s_3i"), PoseParams(estimator="stance_foot_anchor")):
        assert not mounted(take, params).turned_rad
    assert not mounted(only(take, *FEET), PoseParams()).turned_rad


def test_segment_names_are_known() -> None:
    assert set(WHOLE) <= set(SEGMENTS)


def _down(q: Floats, length: float) -> Floats:
    from sagittal.core.rotation import rotate

    return rotate(q, np.array([0.0, -length, 0.0]))


def _after_turning(path: Floats, true: Floats) -> Floats:
    """Difference of two paths in the plane (n, 2) after the best common turn."""
    a, b = path[:, 0] + 1j * path[:, 1], true[:, 0] + 1j * true[:, 1]
    turn = np.vdot(a, b)
    return np.asarray(np.abs(a * turn / abs(turn) - b))
