"""The kinematic walk as a finished analysis: in memory, as files, and stored in a clinic without a worker."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from core.body.estimate import PoseEstimate
from core.calibration.result import CalibratedRecording, Calibration, SegmentCalibration
from core.errors import Notice
from core.events.foot_pitch import pitch_signal
from core.frames import FOOT, SIDES, Segment
from core.fusion.orientations import Orientations
from core.measure import measure_gait
from core.pipeline import TakeAnalysis
from core.quality import QualityReport
from core.recording import Recording, SensorSignals, Subject, UniformRecording
from server.report.exports import analysis_files
from server.services import analyses, recordings
from tests.server import walk
from tests.server.clinic import Clinic


def analysis(*, duration_s: float = 12.0, reached: bool = True) -> TakeAnalysis:
    """The walk with a still sensor on the pelvis, and on each foot one that measures its pitching."""
    tracks = walk.tracks(duration_s)
    n = len(tracks.t_s)
    zeros = np.zeros((n, 3))
    sensors: dict[Segment, SensorSignals] = {"pelvis": _sensor("A1", zeros)}
    for side in SIDES:
        pitch = np.arcsin(pitch_signal(tracks.q[FOOT[side]]))
        turning = np.stack((zeros[:, 0], zeros[:, 0], np.gradient(pitch, tracks.t_s)), axis=1)
        sensors[FOOT[side]] = _sensor(f"F-{side}", turning)
    problem = None if reached else Notice("no_rest", "No rest found.", severity="error")
    mounted = SegmentCalibration(np.eye(3), np.array([0.01, 0.0, np.nan]), 9.8, "walking_direction", 0.9)
    lost = Notice("gap", "0.3 s lost.", "pelvis", 1.0)
    uniform = UniformRecording(tracks.t_s, 100.0, sensors, Subject(1.75), "walk", {}, notices=(lost,))
    calibration = Calibration(
        dict.fromkeys(sensors, mounted),
        ((0.0, 2.0),),
        ((2.0, 9.0),),
        (0.0, 2.0),
        np.zeros(n, bool),
        "walking_direction",
    )
    orientations = Orientations(tracks.t_s, 100.0, dict(tracks.q), dict(tracks.valid), "mahony")
    found = TakeAnalysis(
        source=Recording({}, {}, sha256={"a.txt": "ff"}),
        version="1",
        uniform=uniform,
        report=QualityReport("good", (), duration_s, 100.0, MappingProxyType({}), ((0.0, 2.0),), ()),
        problem=problem,
    )
    if not reached:
        return found
    return replace(
        found,
        calibrated=CalibratedRecording(uniform, calibration),
        posed=PoseEstimate(orientations, walk.poses(duration_s), None),
        angles=tracks.angles,
        tracks=tracks,
        measured=measure_gait(tracks),
    )


def _sensor(device: str, gyr: Any) -> SensorSignals:
    n = len(gyr)
    return SensorSignals(device, np.zeros((n, 3)), gyr, None, np.ones(n, bool), np.zeros(n, bool))


@functools.cache
def files(duration_s: float = 12.0) -> Mapping[str, bytes]:
    """Its result files."""
    return analysis_files(analysis(duration_s=duration_s))


def finish(
    clinic: Clinic,
    patient_id: str,
    session_id: str,
    results: Mapping[str, bytes],
    manifest: Mapping[str, Any] | None = None,
) -> str:
    """Do what upload and worker do, with given results; returns the id of the analysis."""
    state = clinic.app.state
    with recordings.receive(clinic.db, state.blobs, clinic.settings, None, session_id, "walk.txt") as upload:
        upload.write(b"recording")
        upload.keep()
    with clinic.db.write() as c:
        if manifest is not None:
            recordings.set_manifest(c, None, session_id, manifest)
        analyses.submit(c, state.queue, None, session_id)
    claim = state.queue.claim("test", [recordings.ANALYSE])
    stored = {name: state.blobs.put(patient_id, content) for name, content in results.items()}
    assert state.queue.finish(claim, lambda c: analyses.publish(c, claim, stored, "0" * 64))
    with clinic.db.read() as c:
        return analyses.get_shown(c, session_id).id
