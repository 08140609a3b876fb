"""Whatever piece of a take arrives: a finite result or an error of ours with a code, never anything else."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.angles.measure import measure_angles
from sagittal.core.body import forward_kinematics, nominal_body
from sagittal.core.calibration import CalibrationParams, calibrate
from sagittal.core.calibration.anterior import Method
from sagittal.core.errors import SagittalError
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import simulate_scenario
from sagittal.core.timeline import synchronise
from tests.helpers.walks import cut, only, rms_deg, simulated

CODES = {"no_rest", "not_still", "rest_too_short", "no_walking", "not_single_axis", "pelvis_heading_unknown"}


def _attempt(recording: UniformRecording, params: CalibrationParams) -> CalibratedRecording | SagittalError:
    try:
        return calibrate(recording, params)
    except SagittalError as error:
        return error


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_any_piece_with_any_sensors_ends_in_a_result_or_a_code(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = ("comfortable", "slow", "fast_with_turns", "lost_sensor")
    recording, _ = simulated(names[seed % len(names)])
    start = float(rng.uniform(0, recording.t_s[-1] - 2.0)) * (rng.random() > 0.3)
    piece = cut(recording, start, start + float(rng.choice([0.1, 1.0, 3.0, 10.0, 20.0, 40.0])))
    permutation = rng.permutation(list(recording.sensors))[: rng.integers(1, 8)]
    method: Method = "gyro_pca" if rng.random() < 0.3 else "walking_direction"
    calibrated = _attempt(only(piece, *permutation), CalibrationParams(method=method))
    if isinstance(calibrated, SagittalError):
        assert calibrated.code in CODES
        assert len(calibrated.message) > 30
        return
    orientations = estimate_orientations(calibrated)
    angles = measure_angles(orientations, calibrated.calibration.zero)
    poses = forward_kinematics(orientations, nominal_body(None)[0])
    assert all(np.isfinite(q).all() for q in orientations.q.values())
    assert all(np.isfinite(p).all() for p in poses.p.values())
    assert set(angles.angles) == set(angles.zero_offset)


@pytest.mark.sweep
@pytest.mark.parametrize("rate_hz", [60.0, 128.0, 512.0])
def test_flexion_is_right_at_any_sampling_rate(rate_hz: float) -> None:
    take = simulate_scenario("slow", 3, rate_hz=rate_hz)
    recording, truth = synchronise(take.recording), take.truth
    calibrated = calibrate(recording)
    angles = measure_angles(estimate_orientations(calibrated), calibrated.calibration.zero).angles
    n = min(len(recording.t_s), len(truth.t_s))
    for name in ("hip_flexion_l", "knee_flexion_r", "ankle_dorsiflexion_l"):
        assert rms_deg(angles[name][:n] - truth.subtract_standing()[name][:n]) < 1.5
