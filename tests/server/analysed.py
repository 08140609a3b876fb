"""The kinematic walk as a finished analysis: in memory, as files, and stored in a clinic without a worker."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from sagittal.core.body.estimate import PoseEstimate
from sagittal.core.errors import Notice
from sagittal.core.events.foot_pitch import pitch_signal
from sagittal.core.filter_comparison.result import (
    FilterAgreement,
    FilterComparison,
    FilterRequest,
    FilterSpread,
)
from sagittal.core.frames import FOOT, SIDES, Segment
from sagittal.core.fusion.algorithms.benchmark import OrientationScore
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.pipeline import TakeAnalysis
from sagittal.core.quality import QualityReport
from sagittal.core.rotation import about
from sagittal.core.signals.calibrated import CalibratedRecording, Calibration, SegmentCalibration
from sagittal.core.signals.recording import Recording, SensorSignals, Subject, UniformRecording
from sagittal.server.clinic import sessions
from sagittal.server.commands.science.sensitivity import analyse_simulated
from sagittal.server.jobs.queue import COMPARE_FILTERS, SENSITIVITY
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.files.filter_files import filter_run_files
from sagittal.server.report.view.sensitivity import sensitivity_files, summarise_sensitivity
from sagittal.server.results import analyses, filter_runs, sensitivities
from sagittal.server.uploads import receiving, recordings
from tests.helpers.clinic import Clinic
from tests.server import walk


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
    mounted = SegmentCalibration(
        np.eye(3), np.array([0.01, 0.0, np.nan]), 9.8, "walking_direction", 0.9, forward_sd=0.05
    )
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
    take_analysis = TakeAnalysis(
        source=Recording({}, {}, sha256={"a.txt": "ff"}),
        version="1",
        uniform=uniform,
        report=QualityReport("good", (), duration_s, 100.0, MappingProxyType({}), ((0.0, 2.0),), ()),
        problem=problem,
    )
    if not reached:
        return take_analysis
    return replace(
        take_analysis,
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
    with receiving.receive(clinic.db, state.blobs, clinic.settings, None, session_id, "walk.txt") as upload:
        upload.write(b"recording")
        upload.keep()
    with clinic.db.write() as c:
        if manifest is not None:
            recordings.set_manifest(c, None, session_id, manifest)
        analyses.submit(c, state.queue, None, session_id)
    return publish_next(clinic, session_id, results)


def publish_next(clinic: Clinic, session_id: str, results: Mapping[str, bytes] | None = None) -> str:
    """Process the next requested analysis like a worker; return the id of the current analysis."""
    state = clinic.app.state
    with clinic.db.read() as c:
        patient_id = sessions.get(c, session_id).patient_id
    claim = state.queue.claim("test", [recordings.ANALYSE])
    stored = {name: state.blobs.put(patient_id, x) for name, x in (results or files()).items()}
    assert state.queue.finish(claim, lambda c: analyses.publish(c, claim, stored, "0" * 64))
    with clinic.db.read() as c:
        return analyses.get_shown(c, session_id).id


def comparison() -> FilterComparison:
    """Two filters, 1° apart in the left knee in stance and 2° in swing, and one that needs a magnetometer."""
    t_s = np.linspace(0.0, 10.0, 101)
    sd = np.radians(np.full(101, 0.5))
    half = OrientationScore(*np.radians((0.5, 0.3, 0.4)).tolist())
    knee = FilterSpread(
        "knee_flexion_l", 2, sd, 2.0 * sd, {"left": sd}, {"left": float(sd[0])}, {"left": float(2 * sd[0])}
    )
    pelvis = FilterSpread("pelvis_heading", 2, sd, 2.0 * sd, {}, {}, {})
    refused = Notice("no_magnetometer", "Martin2010 needs a magnetometer.")
    rows = (
        FilterAgreement(None, "Sagittal, as analysed", None, half, None, {}),
        FilterAgreement("mahony_2008", "Mahony2008", 0.25, half, half, {"pelvis": half}),
        FilterAgreement("wu_2018", "Wu2018 (reconstruction)", 0.5, half, half, {"pelvis": half}),
        FilterAgreement("martin_2010", "Martin2010", None, None, None, {}, (refused,)),
    )
    request = FilterRequest(("mahony_2008", "wu_2018", "martin_2010"), magnetometer=False)
    return FilterComparison(
        request,
        t_s,
        ("pelvis",),
        {"left": 4, "right": 0},
        rows,
        (knee, pelvis),
        None,
        (),
        {name: {"pelvis": about(2, 0.1 * t_s)} for name in (None, "mahony_2008", "wu_2018")},
        {"pelvis": t_s < 9.95},
    )


def compare(clinic: Clinic, patient_id: str, session_id: str) -> str:
    """Do what form and worker do with `comparison`; returns the id of the run."""
    state = clinic.app.state
    with clinic.db.write() as c:
        filters = ["mahony_2008", "wu_2018", "martin_2010"]
        filter_runs.submit(c, state.queue, None, session_id, filters=filters, magnetometer=False)
    claim = state.queue.claim("test", [COMPARE_FILTERS])
    results = filter_run_files(comparison())
    stored = {name: state.blobs.put(patient_id, content) for name, content in results.items()}
    assert state.queue.finish(claim, lambda c: filter_runs.publish(c, claim, {}, stored))
    with clinic.db.read() as c:
        return filter_runs.of_session(c, session_id)[0].id


@functools.cache
def sensitivity() -> Mapping[str, bytes]:
    """Sensitivity analysis of a simulated squat as files."""
    return sensitivity_files(
        summarise_sensitivity(analyse_simulated(1, "right"), None, from_standing=True), "sensitivity"
    )


def put_off(clinic: Clinic, patient_id: str, session_id: str) -> str:
    """Do what form and worker do with `sensitivity`; returns the id of the analysis, that of its job."""
    state = clinic.app.state
    with clinic.db.write() as c:
        job_id = sensitivities.submit(c, state.queue, None, session_id).id
    claim = state.queue.claim("test", [SENSITIVITY])
    stored = {name: state.blobs.put(patient_id, content) for name, content in sensitivity().items()}
    assert state.queue.finish(claim, lambda c: sensitivities.publish(c, claim, {}, stored))
    return job_id
