"""Calibration score: no redo on clean recordings, and detection of anterior-axis errors of known size.

Limits come from simulated people (`knee_axis`, `stillness`) and, where soft tissue and asymmetry are larger,
from neura_walk and qmt_fullbody (`mirror`, `heading_spread`); gaitmap_foot and ipol_walks were not used.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from sagittal.core.agreement import check_agreement
from sagittal.core.body.mounting import mount_sensors
from sagittal.core.calibration import calibrate
from sagittal.core.calibration.score import CalibrationScore, score_calibration
from sagittal.core.calibration.score_rules import RULES
from sagittal.core.frames import SHANK, SIDES, THIGH, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.pipeline import PipelineConfig
from sagittal.core.quality.stuck import drop_stuck_sensors
from sagittal.core.rotation import about, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import RecordingSetup, SwingsAndBows, simulate_swings_and_bows
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.timeline import synchronise
from tests.helpers.gaitmap import RATE, recording_of, signals
from tests.helpers.ipol import WALKS, ipol_recording
from tests.helpers.walks import simulated
from validation.accuracy.test_setup_mistakes import right
from validation.figures import record

PEOPLE = ("healthy", "elderly", "hemiparetic", "crouch", "stiff_knee")
TURNS_DEG = (-30.0, -20.0, -15.0, -10.0, -5.0, 5.0, 10.0, 15.0, 20.0, 30.0)


def list_clean() -> Mapping[str, tuple[UniformRecording, ...]]:
    return {
        "neura_walk": (synchronise(right("neura_walk")),),
        "qmt_fullbody": (synchronise(right("qmt_fullbody")),),
        "gaitmap_foot": (synchronise(recording_of(signals("imu_sample.csv"), RATE)),),
        "ipol_walks, feet": tuple(synchronise(ipol_recording(w, "foot_l", "foot_r")) for w in WALKS),
    }


def score_as_used(recording: UniformRecording) -> CalibrationScore:
    """As the pipeline does, after the joints had their say."""
    agreed = check_agreement(recording)
    calibrated = calibrate(drop_stuck_sensors(agreed.recording))
    config = PipelineConfig()
    mounted = mount_sensors(calibrated, estimate_orientations(calibrated, config.fusion), config.poses)
    return score_calibration(mounted.calibrated, None, agreed, mounted.turned_rad)


def test_clean_recordings_need_no_redo() -> None:
    rows = []
    for name, takes in list_clean().items():
        scores = [score_as_used(x) for x in takes]
        assert [c for s in scores for c in s.checks if c.verdict == "redo"] == []
        assert all(s.verdict == "pass" for s in scores)
        worst: dict[str, float] = {}
        for check in (c for s in scores for c in s.checks if c.verdict == "pass"):
            if check.value is not None:
                choose = min if check.rule.least else max
                worst[check.name] = choose(worst.get(check.name, check.value), check.value)
        rows.append([name, *(f"{worst[r.name]:.2f}" if r.name in worst else "–" for r in RULES[1:])])
    header = [
        "worst value that was judged",
        *(f"{r.title}{f', {r.unit}' if r.unit else ''}" for r in RULES[1:]),
    ]
    record("Calibration score on clean recordings", header, rows, "No check of them says redo.")


@cache
def person(name: str) -> tuple[CalibratedRecording, dict[str, float]]:
    """Calibrated virtual person, and the true difference of the axes at each knee, degrees."""
    recording, truth = simulated(name, 5)
    calibrated = calibrate(recording)
    turned = {}
    for s, x in calibrated.calibration.segments.items():
        forward = (x.R_segment_sensor @ to_matrix(truth.mounts[s].q_segment_sensor).T)[:, 0]
        turned[s] = float(np.degrees(np.arctan2(-forward[2], forward[0])))
    return calibrated, {side: turned[THIGH[side]] - turned[SHANK[side]] for side in SIDES}


def turn_axis(calibrated: CalibratedRecording, segment: Segment, degrees: float) -> CalibratedRecording:
    calibration = calibrated.calibration
    was = calibration.segments[segment]
    R = to_matrix(about(1, np.radians(degrees))) @ was.R_segment_sensor
    segments = {**calibration.segments, segment: replace(was, R_segment_sensor=R)}
    return replace(calibrated, calibration=replace(calibration, segments=segments))


def test_the_knee_measures_a_wrong_forward_axis() -> None:
    errors: list[float] = []
    result: defaultdict[int, list[bool]] = defaultdict(list)
    for name in PEOPLE:
        calibrated, apart = person(name)
        for side in SIDES:
            for degrees in (0.0, *TURNS_DEG):
                score = score_calibration(turn_axis(calibrated, SHANK[side], degrees))
                check = next(c for c in score.checks if c.name == "knee_axis" and c.segment == SHANK[side])
                assert check.value is not None
                true = abs(apart[side] - degrees)
                errors.append(check.value - true)
                result[min(30, 10 * int(true // 10))].append(check.verdict == "redo")
    rms = float(np.sqrt(np.mean(np.square(errors))))
    assert rms < 2.0
    assert np.mean(result[20] + result[30]) == 1.0
    assert np.mean(result[0]) < 0.15
    rows = [
        [
            f"{a} to {a + 10}°" if a < 30 else "30° and more",
            str(len(result[a])),
            f"{100 * np.mean(result[a]):.0f}",
        ]
        for a in sorted(result)
    ]
    note = (
        f"{len(PEOPLE)} virtual people, the forward axis of one shank turned by −30 to 30°. The value of "
        f"the check is the true difference of thigh and shank with an RMS error of {rms:.1f}°."
    )
    record("Knee axis against known errors", ["true difference", "cases", "redo %"], rows, note)


def test_swings_and_bows_recover_random_mountings() -> None:
    rows = []
    for title, setup in (("rigid", RecordingSetup()), ("on skin", ON_SKIN)):
        errors: defaultdict[str, list[float]] = defaultdict(list)
        for seed in range(8):
            swings_and_bows = simulate_swings_and_bows(
                SwingsAndBows(swings=10, bows=5), seed=seed, setup=setup
            )
            for s, x in calibrate(synchronise(swings_and_bows.recording)).calibration.segments.items():
                off = x.R_segment_sensor @ to_matrix(swings_and_bows.truth.mounts[s].q_segment_sensor).T
                angle = float(np.degrees(np.arccos(np.clip(0.5 * (np.trace(off) - 1.0), -1.0, 1.0))))
                errors[s.partition("_")[0]].append(angle)
        assert all(max(x) < 2.0 for x in errors.values())
        rows.append([title, *(f"{np.median(errors[s]):.1f} / {max(errors[s]):.1f}" for s in sorted(errors))])
    header = ["helical error, median / largest °", *sorted(errors)]
    note = (
        "Eight random mountings of seven sensors each, simulated. No real recording of these movements is "
        "among ours."
    )
    record("Swings and bows", header, rows, note)
