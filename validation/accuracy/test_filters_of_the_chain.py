"""Which filter carries the product's angles: the tilt filter or the self-calibrating one, on walks.

Calibration, heading drift and angles are the product's own; only the orientation of the sensors differs. The
self-calibrating filter's result belongs to the end of a sample's interval and ours to the sample, so it is
taken half a sample earlier; its heading is set at the standing.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from sagittal.core.angles.measure import measure_angles
from sagittal.core.calibration import calibrate
from sagittal.core.frames import R_NEUTRAL, Floats
from sagittal.core.fusion.drift import DriftParams, remove_relative_drift
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.fusion.self_calibrating import SelfCalibratingFilter
from sagittal.core.rotation import conjugate, from_matrix, multiply, normalise, rotate
from sagittal.core.signals.calibrated import CalibratedRecording
from tests.data import data_folder
from tests.helpers.neura_angles import reference as neura_reference
from tests.helpers.neura_angles import scores
from tests.helpers.walks import neura_walk, rms_deg, simulated
from validation.accuracy.test_events_trunk_qmt import take as qmt_take
from validation.accuracy.test_l7s_both_ways import QMT_NAMES
from validation.figures import record
from validation.marks import sample, whole_only

FILTERS = ("tilt filter, both ways", "self-calibrating, live", "self-calibrating, both ways")
SCRIPTS = ("comfortable", "slow", "fast_with_turns", "five_minutes")
FLEXION = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")


def self_calibrated(calibrated: CalibratedRecording, *, both_ways: bool) -> Orientations:
    """As `estimate_orientations`, by the self-calibrating filter without its magnetometer."""
    recording, calibration = calibrated.recording, calibrated.calibration
    q, valid = {}, {}
    for segment, mounted in calibration.segments.items():
        signals = recording.sensors[segment]
        gyr, acc = (signals.gyr - mounted.gyro_bias)[:, None], signals.acc[:, None]
        run = SelfCalibratingFilter(recording.rate_hz, magnetometer=False)
        result = (run.smooth(gyr, acc) if both_ways else run.advance(gyr, acc))[:, 0]
        result[1:] = normalise(
            result[:-1] + result[1:] * np.sign(np.sum(result[1:] * result[:-1], axis=1))[:, None]
        )
        start = mounted.start_q
        start = from_matrix(R_NEUTRAL @ mounted.R_segment_sensor) if start is None else start
        index = min(round(0.5 * sum(calibration.zero) * recording.rate_hz), len(result) - 1)
        heading = multiply(start, conjugate(result[index])) * [1.0, 0.0, 0.0, 1.0]
        sensor = multiply(normalise(heading), result)
        q[segment] = multiply(sensor, conjugate(from_matrix(mounted.R_segment_sensor)))
        valid[segment] = signals.valid
    q, _, _ = remove_relative_drift(q, valid, calibration, recording.rate_hz, DriftParams())
    return Orientations(recording.t_s, recording.rate_hz, q, valid, "self_calibrating")


def orient(calibrated: CalibratedRecording, name: str) -> Orientations:
    if name == FILTERS[0]:
        return estimate_orientations(calibrated)
    return self_calibrated(calibrated, both_ways=name == FILTERS[2])


@cache
def on_neura(name: str) -> Floats:
    """RMSE (3,) of hip, knee, ankle flexion, offset removed, mean of both sides, °."""
    calibrated = calibrate(neura_walk())
    angles = measure_angles(orient(calibrated, name), calibrated.calibration.zero)
    result = {n: np.degrees(x + angles.zero_offset[n]) for n, x in angles.angles.items()}
    assert neura_reference()
    _, score = scores(result)
    return np.array([np.mean([score[f"{n}_{side}"].offset_removed for side in "rl"]) for n in FLEXION])


@cache
def on_simulated(script: str, name: str) -> Floats:
    """RMS error (3,) of hip, knee, ankle flexion, mean of both sides, °."""
    recording, truth = simulated(script, 0)
    calibrated = calibrate(recording)
    angles = measure_angles(orient(calibrated, name), calibrated.calibration.zero).angles
    true, n = truth.subtract_standing(), min(len(recording.t_s), len(truth.t_s))
    return np.array(
        [
            np.mean([rms_deg(angles[f"{x}_{side}"][:n] - true[f"{x}_{side}"][:n]) for side in "rl"])
            for x in FLEXION
        ]
    )


@cache
def on_qmt(name: str) -> float:
    """RMS inclination of seven segments to the orientations that come with the recording, °.

    Theirs are in other segment axes: one constant rotation a segment is fitted.
    """
    calibrated = calibrate(qmt_take(QMT_NAMES))
    ours = orient(calibrated, name)
    data = loadmat(
        data_folder("qmt_fullbody") / "full_body_example_data.mat", squeeze_me=True, struct_as_record=False
    )
    up, squares = np.array([0.0, 0.0, 1.0]), []
    for segment, theirs in QMT_NAMES:
        a = rotate(conjugate(ours.q[segment]), up)
        b = rotate(conjugate(np.array(data[theirs].quat, np.float64)), up)
        apart = Rotation.align_vectors(a, b)[0].apply(b)
        squares.append(np.mean(np.arccos(np.clip(np.sum(a * apart, axis=1), -1.0, 1.0)) ** 2))
    return float(np.degrees(np.sqrt(np.mean(squares))))


def test_the_tilt_filter_is_no_worse_than_the_dearer_one() -> None:
    for name in FILTERS[1:]:
        assert on_neura(FILTERS[0]).mean() <= on_neura(name).mean() + 0.15
        for script in sample(SCRIPTS, 4):
            assert on_simulated(script, FILTERS[0]).mean() <= on_simulated(script, name).mean() + 0.15


@whole_only
def test_write_down_the_figures_of_the_three() -> None:
    rows = []
    for name in FILTERS:
        walks = [on_neura(name), *(on_simulated(script, name) for script in SCRIPTS)]
        rows.append([name, *(" / ".join(f"{x:.2f}" for x in w) for w in walks), f"{on_qmt(name):.2f}"])
    record(
        "Which filter carries the angles",
        ["filter", "neura_walk", *(s.replace("_", " ") for s in SCRIPTS), "qmt_fullbody"],
        rows,
        "Flexion of hip / knee / ankle, RMS error in degrees, mean of both sides, before the pose estimator: "
        "neura_walk against Vicon, offset removed; simulated walks against their truth. qmt_fullbody: "
        "inclination of seven segments to the recording's own orientations, which are of sensors too and no "
        "truth. The same calibration and removal of relative drift for all; six axes.",
    )
