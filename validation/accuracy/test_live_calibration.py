"""How near calibration from the first steps of a take comes to that from the whole take: figures for docs.

Live there is one standing and eight straight steps, or twelve seconds; offline both standings and the whole
walk. neura_walk is a real walk, where only the two can be compared; the virtual people have exact truth, in
which the feet point outwards by some degrees that no calibration from walking can see.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.body import nominal_body
from sagittal.core.body.apart import lean_legs_apart
from sagittal.core.body.erkf.headings import align_forward_axes
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.tree import PRESETS
from sagittal.core.calibration import calibrate
from sagittal.core.calibration.live_attempt import WornSensors
from sagittal.core.frames import Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.online.calibrated import LiveCalibration, compile_calibration_kernels
from sagittal.core.online.calibrating import LiveCalibrator
from sagittal.core.rotation import from_matrix, log
from sagittal.core.signals.calibrated import CalibratedRecording, Calibration
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.timeline.live import UniformBlock
from tests.helpers.walks import neura_walk, simulated
from validation.figures import record

SEGMENTS = PRESETS["lower_body7"]
WALKS = ("neura_walk", "comfortable", "slow", "fast_with_turns", "five_minutes")
PATIENTS = (
    "hemi_mild",
    "hemiparetic",
    "stiff_knee",
    "drop_foot",
    "crouch",
    "antalgic",
    "parkinson",
    "elderly",
)
LIMIT_DEG = 6.0
"""Any axis on able-bodied walks: within the rotation of a sensor by soft tissue."""


def take(name: str) -> UniformRecording:
    return neura_walk() if name == "neura_walk" else simulated(name, 0)[0]


@cache
def live(name: str) -> LiveCalibration:
    """The live calibration of a take."""
    compile_calibration_kernels()
    recording = take(name)
    sensors = recording.sensors.values()
    acc, gyr = (np.stack([getattr(s, k) for s in sensors], axis=1) for k in ("acc", "gyr"))
    valid, filled = (np.stack([getattr(s, k) for s in sensors], axis=1) for k in ("valid", "interpolated"))
    calibrator = LiveCalibrator(
        WornSensors(
            tuple(recording.sensors),
            recording.rate_hz,
            recording.subject,
            recording.protocol,
            recording.mounting,
        )
    )
    for a in range(0, len(recording.t_s), 10):
        p = slice(a, a + 10)
        block = UniformBlock(a, recording.t_s[p], acc[p], gyr[p], valid[p], filled[p])
        frame = calibrator.push(block)
        if frame is not None:
            return frame
    raise AssertionError(f"{name}: never calibrated; {calibrator.stage}, {calibrator.view}")


@cache
def offline(name: str) -> CalibratedRecording:
    """As the pipeline: on the whole take."""
    recording = take(name)
    calibrated = calibrate(recording)
    body, _ = nominal_body(recording.subject.height_m, recording.subject.standing_width_m)
    calibrated, orientations = lean_legs_apart(calibrated, estimate_orientations(calibrated), body)
    return align_forward_axes(calibrated, orientations, body, SEGMENTS, ErkfParams.people())[0]


def apart(a: Calibration, b: Calibration) -> dict[Segment, tuple[float, float]]:
    """Segment → degrees between two calibrations: of the forward axis, of the long axis."""
    out: dict[Segment, tuple[float, float]] = {}
    for s in SEGMENTS:
        turn = np.degrees(log(from_matrix(a.segments[s].R_segment_sensor @ b.segments[s].R_segment_sensor.T)))
        out[s] = abs(float(turn[1])), float(np.hypot(turn[0], turn[2]))
    return out


@pytest.mark.parametrize("name", WALKS)
def test_the_first_steps_give_nearly_the_axes_of_the_whole_take(name: str) -> None:
    live_result = live(name)
    for segment, (forward, up) in apart(
        live_result.calibrated.calibration, offline(name).calibration
    ).items():
        assert forward < LIMIT_DEG, (segment, forward)
        assert up < 1.0, (segment, up)


@pytest.mark.parametrize("name", WALKS)
def test_the_attempt_is_called_good(name: str) -> None:
    assert live(name).ok


@pytest.mark.parametrize("name", PATIENTS)
def test_virtual_patients_are_calibrated_live(name: str) -> None:
    live_result = live(name)
    assert set(live_result.calibrated.calibration.segments) >= set(SEGMENTS)


def test_write_down_the_figures() -> None:
    rows = []
    for name in (*WALKS, *PATIENTS):
        live_result = live(name)
        off = apart(live_result.calibrated.calibration, offline(name).calibration)
        forward = {s: off[s][0] for s in SEGMENTS}
        worst = max(forward, key=lambda s: forward[s])
        rows.append(
            [
                name,
                f"{(live_result.past - live_result.first) / live_result.calibrated.recording.rate_hz:.1f}",
                f"{live_result.calibrated.calibration.straight_steps}",
                f"{np.mean(list(forward.values())):.1f}",
                f"{forward[worst]:.1f} ({worst})",
                f"{max(x[1] for x in off.values()):.1f}",
                "good"
                if live_result.ok
                else ", ".join(sorted({n.code for c in live_result.checks for n in c.notices})),
            ]
        )
    record(
        "Live calibration",
        [
            "take",
            "s of samples",
            "straight steps",
            "forward, mean °",
            "forward, worst °",
            "up, worst °",
            "told",
        ],
        rows,
        "Axes from one standing and the first steps, against those of the whole take offline; where all are "
        "off alike, only the way ahead is. Limits, of the "
        f"five walks above the virtual patients: forward < {LIMIT_DEG:g}°, up < 1°, told good.",
    )
