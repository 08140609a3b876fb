"""The score of a calibration: each check sees its own mistake, and a clean walk passes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement import Agreement
from sagittal.core.calibration import calibrate
from sagittal.core.calibration.knee_axis import find_knee_axes
from sagittal.core.calibration.score import (
    CalibrationCheck,
    CalibrationScore,
    judge_together,
    score_calibration,
)
from sagittal.core.calibration.score_rules import RULES, CheckName
from sagittal.core.frames import Floats, Segment
from sagittal.core.rotation import about, exp, multiply, rotate, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording, SegmentCalibration
from sagittal.core.signals.rest import index_window
from tests.helpers.walks import only, simulated


@cache
def clean() -> CalibratedRecording:
    return calibrate(simulated()[0])


def turn_axis(segment: Segment, degrees: float) -> CalibratedRecording:
    """The same calibration with the forward axis of one segment turned."""
    calibration = clean().calibration
    was = calibration.segments[segment]
    R = to_matrix(about(1, np.radians(degrees))) @ was.R_segment_sensor
    segments = {**calibration.segments, segment: replace(was, R_segment_sensor=R)}
    return replace(clean(), calibration=replace(calibration, segments=segments))


def find(score: CalibrationScore, name: CheckName, segment: Segment | None) -> CalibrationCheck:
    return next(c for c in score.checks if (c.name, c.segment) == (name, segment))


def test_a_clean_walk_passes_and_says_what_it_cannot_judge() -> None:
    score = score_calibration(clean())
    assert score.verdict == "pass"
    assert {score.judge_segment(s) for s in clean().recording.sensors} == {"pass"}
    assert {c.name for c in score.checks} == {rule.name for rule in RULES}
    for check in score.checks:
        assert (check.why == "") == (check.verdict == "pass")
        assert check.todo == ""
    assert find(score, "joint_misfit", "pelvis").value is None
    assert find(score, "mirror", "pelvis").verdict == "not_judged"


@pytest.mark.parametrize("degrees", [-15.0, 15.0, 30.0])
def test_the_knee_shows_a_turned_forward_axis_of_thigh_or_shank(degrees: float) -> None:
    initial_matches = find(score_calibration(clean()), "knee_axis", "thigh_l")
    assert initial_matches.value is not None
    assert initial_matches.value < 5.0
    score = score_calibration(turn_axis("shank_l", degrees))
    for segment in ("thigh_l", "shank_l"):
        check = find(score, "knee_axis", segment)
        assert check.value == pytest.approx(abs(degrees), abs=5.0)
        assert check.verdict == "redo"
        assert check.todo
        assert check.why
    assert find(score, "knee_axis", "thigh_r").verdict == "pass"
    assert find(score, "mirror", "shank_r").value == pytest.approx(abs(degrees), abs=5.0)


def test_a_lean_while_standing_is_seen_and_is_half_of_it_in_the_upright() -> None:
    recording = simulated()[0]
    zero = clean().calibration.zero
    part = index_window(zero, recording.rate_hz)
    x = recording.sensors["thigh_l"]
    lean = np.zeros((len(x.acc), 3))
    lean[part, 0] = np.radians(np.linspace(-3.0, 3.0, part.stop - part.start))
    leaned = replace(x, acc=rotate(exp(lean), x.acc))
    changed = replace(recording, sensors={**recording.sensors, "thigh_l": leaned})
    score = score_calibration(replace(clean(), recording=changed))
    check = find(score, "stillness", "thigh_l")
    assert check.value == pytest.approx(5.0, abs=1.5)
    assert check.verdict == "redo"
    assert find(score, "stillness", "thigh_r").verdict == "pass"


def test_an_accelerometer_off_gravity_is_seen() -> None:
    calibration = clean().calibration
    off = replace(calibration.segments["foot_l"], rest_norm=11.2)
    changed = replace(calibration, segments={**calibration.segments, "foot_l": off})
    check = find(score_calibration(replace(clean(), calibration=changed)), "gravity", "foot_l")
    assert check.value == pytest.approx(14.2, abs=0.1)
    assert check.verdict == "redo"


def test_few_steps_and_a_wobbling_sensor_are_seen() -> None:
    few = replace(clean(), calibration=replace(clean().calibration, straight_steps=5))
    assert find(score_calibration(few), "repetitions", None).verdict == "redo"
    x = clean().recording.sensors["shank_r"]
    wobble = np.random.default_rng(0).normal(0.0, 6.0, x.gyr.shape)
    shaken = replace(
        clean().recording, sensors={**clean().recording.sensors, "shank_r": replace(x, gyr=x.gyr + wobble)}
    )
    check = find(score_calibration(replace(clean(), recording=shaken)), "axis_share", "shank_r")
    assert check.verdict == "redo"
    assert check.value is not None
    assert check.value < 0.7


def test_joints_and_their_turns_speak() -> None:
    agreed = Agreement(
        clean().recording,
        misfits={("thigh_l", "shank_l"): 1.4, ("shank_l", "foot_l"): 1.3, ("pelvis", "thigh_l"): 0.4},
    )
    score = score_calibration(clean(), None, agreed, {"shank_l": np.radians(40.0), "foot_l": 0.0})
    assert find(score, "joint_misfit", "shank_l").value == 1.3
    assert find(score, "joint_misfit", "shank_l").verdict == "redo"
    assert find(score, "joint_misfit", "thigh_l").verdict == "pass"
    assert find(score, "heading_spread", "shank_l").verdict == "redo"
    assert score.verdict == "redo"
    notices = score.to_json()
    assert notices["verdict"] == "redo"


def test_a_sensor_without_forward_axis_is_to_be_done_again() -> None:
    calibration = clean().calibration
    left: dict[Segment, SegmentCalibration] = {s: x for s, x in calibration.segments.items() if s != "pelvis"}
    changed = replace(calibration, segments=left)
    score = score_calibration(replace(clean(), calibration=changed))
    assert score.judge_segment("pelvis") == "redo"
    assert find(score, "forward_found", "pelvis").todo


def test_walking_alone_leaves_standing_unjudged() -> None:
    walked = replace(clean(), calibration=replace(clean().calibration, posture="walking"))
    score = score_calibration(walked)
    assert find(score, "stillness", "foot_l").verdict == "not_judged"
    assert find(score, "gravity", "foot_l").verdict == "not_judged"


def test_feet_alone_are_judged() -> None:
    score = score_calibration(calibrate(only(simulated()[0], "foot_l", "foot_r")))
    assert score.verdict == "pass"
    assert find(score, "knee_axis", "foot_l").verdict == "not_judged"


def test_a_hinge_is_found_in_both_segments() -> None:
    rng = np.random.default_rng(1)
    body, bend = rng.normal(0.0, 1.0, (800, 3)), rng.normal(0.0, 2.0, 800)
    tilted: Floats = rotate(multiply(about(1, 0.3), about(0, 0.1)), np.array([0.0, 0.0, 1.0]))
    turn = exp(rng.normal(0.0, 0.5, (800, 1)) * tilted)
    thigh = body
    shank = rotate(about(1, -0.5), rotate(turn, body) + bend[:, None] * tilted)
    knee_axes = find_knee_axes(thigh, shank)
    assert knee_axes.thigh == pytest.approx(0.3, abs=0.01)
    assert knee_axes.shank == pytest.approx(0.3 - 0.5, abs=0.01)
    assert knee_axes.apart == pytest.approx(0.5, abs=0.01)


def test_the_words_are_short_and_each_is_said_once() -> None:
    texts = [text for rule in RULES for text in (rule.means, rule.todo)]
    assert len(set(texts)) == len(texts)
    assert max(len(text.split()) for text in texts) <= 25
    assert judge_together(()) == "not_judged"
