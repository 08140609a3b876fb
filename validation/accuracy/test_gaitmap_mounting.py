"""gaitmap_foot: two feet, rest only at the end, and the same take in another mounting frame."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest

from sagittal.core.calibration import calibrate
from sagittal.core.calibration.anterior import Method
from sagittal.core.calibration.calibrate import CalibrationParams
from sagittal.core.formats import SourceFile, parse_manifest, read_recording
from sagittal.core.frames import Floats
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.rotation import rotate
from sagittal.core.signals.calibrated import Calibration
from sagittal.core.timeline import synchronise
from tests.data import data_folder

COPIES = ("imu_sample.csv", "imu_sample_not_rotated.csv")


@cache
def taken(copy: str, method: Method) -> tuple[Calibration, dict[str, Floats]]:
    """Calibration, and sine of the foot pitch (n,) of both feet."""
    path = data_folder("gaitmap_foot", copy)
    columns = {
        segment: {kind: [f"{sensor}/{kind}_{axis}" for axis in "xyz"] for kind in ("acc", "gyr")}
        for segment, sensor in (("foot_l", "left_sensor"), ("foot_r", "right_sensor"))
    }
    source = {
        "file": copy, "header_rows": 2, "index_column": True, "rate_hz": 204.8, "acc_unit": "m/s2",
        "gyr_unit": "deg/s", "gravity_included": True, "columns": columns,
    }  # fmt: skip
    manifest = parse_manifest(json.dumps({"sources": [source]}).encode())
    recording = read_recording([SourceFile(path.name, path.stat().st_size, path.read_bytes)], manifest)
    calibrated = calibrate(synchronise(recording), CalibrationParams(method=method))
    toe = np.array([1.0, 0.0, 0.0])
    orientations = estimate_orientations(calibrated)
    return calibrated.calibration, {s: rotate(q, toe)[:, 2] for s, q in orientations.q.items()}


@pytest.mark.parametrize("method", ["walking_direction", "gyro_pca"])
def test_both_copies_give_the_same_foot_pitch(method: Method) -> None:
    (_, aligned), (_, raw) = (taken(copy, method) for copy in COPIES)
    for foot in ("foot_l", "foot_r"):
        assert np.degrees(np.abs(aligned[foot] - raw[foot]).max()) < 0.1


def test_rest_at_the_end_is_used_and_forward_is_the_toe() -> None:
    """The aligned copy has x towards the toe: our anterior axis must agree."""
    calibration, _ = taken(COPIES[0], "walking_direction")
    assert calibration.zero[0] > 36.0
    for mounted in calibration.segments.values():
        forward = mounted.R_segment_sensor[0]
        assert np.degrees(np.arccos(forward[0])) < 30.0


def test_a_real_foot_has_the_shares_of_the_spec() -> None:
    """ρ 0.886 and 0.915 over all straight walking (docs/science/calibration.md, "Parameters")."""
    calibration, _ = taken(COPIES[0], "gyro_pca")
    assert calibration.segments["foot_l"].score == pytest.approx(0.886, abs=0.03)
    assert calibration.segments["foot_r"].score == pytest.approx(0.915, abs=0.03)
