"""The default engine: one world for all segments, gaps, drift, errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.angles.measure import measure_angles
from sagittal.core.calibration import calibrate
from sagittal.core.errors import EstimationError
from sagittal.core.frames import R_NEUTRAL, Floats, Segment
from sagittal.core.fusion.attitude import attitude_kernel, compile_attitude_kernel
from sagittal.core.fusion.drift import DriftParams
from sagittal.core.fusion.mahony import MahonyParams, estimate_orientations
from sagittal.core.rotation import about, angle_between, from_matrix, mean, multiply, normalise, rotate, yaw
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import index_window
from tests.helpers.walks import lost, only, rms_deg, simulated, turned

NO_DRIFT = MahonyParams(drift=DriftParams(reference_s=1e9))


def calibrated(name: str = "comfortable") -> CalibratedRecording:
    return calibrate(simulated(name)[0])


def test_warm_compiles_without_a_recording() -> None:
    compile_attitude_kernel()
    assert attitude_kernel.signatures


def test_at_standing_every_segment_faces_forward_and_stands_upright() -> None:
    take = calibrated()
    orientations = estimate_orientations(take)
    for segment, q in orientations.q.items():
        standing = mean(q[index_window(take.calibration.zero, 100.0)])
        R = angle_between(standing, normalise(_neutral()))
        assert np.degrees(R) < 1.0, segment


def _neutral() -> Floats:
    return from_matrix(R_NEUTRAL)


def test_quaternions_are_unit_finite_and_deterministic() -> None:
    take = calibrated()
    orientations, second_orientations = estimate_orientations(take), estimate_orientations(take)
    for segment, q in orientations.q.items():
        assert np.abs(np.linalg.norm(q, axis=1) - 1).max() < 1e-9
        assert np.array_equal(q, second_orientations.q[segment])
    assert orientations.engine == "mahony"


@pytest.mark.slow
def test_inclination_follows_the_truth_within_a_degree() -> None:
    """Long axis of the shank against the truth, both relative to standing, over 5 min."""
    recording, truth = simulated("five_minutes")
    take = calibrate(recording)
    orientations = estimate_orientations(take)
    n = min(len(recording.t_s), len(truth.t_s))
    part = index_window(take.calibration.zero, 100.0)
    for segment in ("shank_l", "shank_r"):
        ours, true = (np.unwrap(_pitch(q[:n])) for q in (orientations.q[segment], truth.q[segment]))
        error = (ours - ours[part].mean()) - (true - true[part].mean())
        assert rms_deg(np.asarray(error)) < 1.0


def _pitch(q: Floats) -> Floats:
    """Sagittal inclination in the segment's own heading."""
    level = multiply(about(2, -yaw(q)), q)
    y = rotate(level, np.array([0.0, 1.0, 0.0]))
    return np.asarray(np.arctan2(-y[:, 0], y[:, 2]))


def test_any_mounting_gives_the_same_orientations() -> None:
    recording, _ = simulated("comfortable")
    rng = np.random.default_rng(3)
    by_segment: dict[Segment, Floats] = {s: normalise(rng.standard_normal(4)) for s in recording.sensors}
    one, other_orientations = (
        estimate_orientations(calibrate(recording)),
        estimate_orientations(calibrate(turned(recording, by_segment))),
    )
    for segment, q in one.q.items():
        assert np.degrees(angle_between(q, other_orientations.q[segment]).max()) < 0.1, segment


@pytest.mark.slow
def test_relative_heading_drift_is_taken_out_over_a_long_walk() -> None:
    """Without the correction the same take fails the limit: the check can fail."""
    recording, truth = simulated("five_minutes", 1)
    take = calibrate(recording)
    held, free = estimate_orientations(take), estimate_orientations(take, NO_DRIFT)
    n = min(len(recording.t_s), len(truth.t_s))

    def worst(q: Mapping[Segment, Floats]) -> float:
        """Largest error in degrees of a relative heading in the last minute, against the first walk's."""
        out = 0.0
        pairs: tuple[tuple[Segment, Segment], ...] = (
            ("pelvis", "thigh_r"), ("thigh_l", "shank_l"), ("shank_r", "foot_r"),
        )  # fmt: skip
        for proximal, distal in pairs:
            ours, true = (np.exp(1j * (yaw(x[distal][:n]) - yaw(x[proximal][:n]))) for x in (q, truth.q))
            error = np.angle(ours * np.conj(true))
            out = max(out, float(np.degrees(abs(np.median(error[-6000:]) - np.median(error[1000:4000])))))
        return out

    assert worst(held.q) < 2.0
    assert worst(free.q) > 3.0
    assert any(x.code == "heading_rereferenced" for x in held.notices)


@pytest.mark.slow
def test_drift_correction_leaves_a_short_walk_alone() -> None:
    take = calibrated("slow")
    params = replace(NO_DRIFT, drift=DriftParams(reference_s=300.0))
    for segment, q in estimate_orientations(take, params).q.items():
        assert np.array_equal(q, estimate_orientations(take, NO_DRIFT).q[segment])


@pytest.mark.slow
def test_drift_correction_does_not_change_flexion() -> None:
    take = calibrated("five_minutes")
    held = measure_angles(estimate_orientations(take), take.calibration.zero).angles
    free = measure_angles(estimate_orientations(take, NO_DRIFT), take.calibration.zero).angles
    for name in ("knee_flexion_l", "knee_flexion_r"):
        assert rms_deg(held[name] - free[name]) < 1.0


def test_a_lost_sensor_is_masked_and_comes_back() -> None:
    recording, truth = simulated("comfortable")
    broken = lost(recording, "shank_l", 15.0, 20.0)
    take = calibrate(broken)
    orientations = estimate_orientations(take)
    assert not orientations.valid["shank_l"][1500:2000].any()
    assert orientations.valid["shank_l"][2000:].all()
    angles = measure_angles(orientations, take.calibration.zero)
    knee = angles.angles["knee_flexion_l"]
    assert np.isnan(knee[1500:2000]).all()
    n = min(len(knee), len(truth.t_s))
    error = knee[:n] - truth.subtract_standing()["knee_flexion_l"][:n]
    assert rms_deg(error[:1500]) < 1.5
    assert rms_deg(error[2100:]) < 5.0


def test_a_lost_pelvis_finds_its_heading_again_and_leaves_the_legs_alone() -> None:
    """The gap covers a turn, so that a held heading would be far off."""
    recording, truth = simulated("fast_with_turns")
    whole = estimate_orientations(calibrate(recording))
    turning = np.flatnonzero(calibrate(recording).calibration.turning) / 100.0
    take = calibrate(lost(recording, "pelvis", float(turning[0]) - 0.2, float(turning[0]) + 3.0))
    orientations = estimate_orientations(take)
    late = slice(round(100 * turning[0]) + 600, round(100 * truth.stands[-1][0]))
    thighs: tuple[Segment, ...] = ("thigh_l", "thigh_r")
    for thigh in thighs:
        ours, true = (
            np.exp(1j * (yaw(x.q[thigh]) - yaw(x.q["pelvis"])))[late] for x in (orientations, whole)
        )
        assert abs(np.degrees(np.angle((ours * np.conj(true)).mean()))) < 8.0
    assert np.degrees(angle_between(orientations.q["shank_l"], whole.q["shank_l"]).max()) < 5.0


def test_feet_alone_are_estimated_as_in_the_full_set() -> None:
    recording, _ = simulated("slow")
    single_orientations = estimate_orientations(calibrate(only(recording, "foot_l", "foot_r")))
    full = estimate_orientations(calibrate(recording))
    for segment in ("foot_l", "foot_r"):
        assert rms_deg(_pitch(single_orientations.q[segment]) - _pitch(full.q[segment])) < 2.0


def test_nothing_calibrated_is_an_error() -> None:
    take = calibrated()
    empty = replace(take.calibration, segments={})
    with pytest.raises(EstimationError) as caught:
        estimate_orientations(CalibratedRecording(take.recording, empty))
    assert caught.value.code == "no_segment"
