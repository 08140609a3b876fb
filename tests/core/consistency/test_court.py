"""All signal laws on one recording: clean walks break none; a doubt holds after an edit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from sagittal.core.consistency.court import judge_sensors
from sagittal.core.consistency.doubt import LATE_FOOT, LAWS
from sagittal.core.events.edits import Edit
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.pipeline import TakeAnalysis, analyse, resume
from sagittal.core.simulate import simulate_scenario
from tests.helpers.perturbations import delay_sensor
from tests.helpers.real_takes import NAMES, analyse_take


@cache
def walk(name: str) -> TakeAnalysis:
    return analyse(simulate_scenario(name, seed=3, worn=("pelvis", "foot_l", "foot_r")).recording)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["healthy", "hemiparetic", "drop_foot", "crouch", "antalgic", "parkinson", "stiff_knee"]
)
def test_nobody_is_accused_for_how_they_walk(name: str) -> None:
    assert not LAWS & {n.code for n in walk(name).notices}


@pytest.mark.recorded
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_no_real_recording_is_accused(name: str) -> None:
    assert not LAWS & {n.code for n in analyse_take(name).notices}


def test_a_doubt_holds_after_an_edit() -> None:
    found = walk("healthy")
    assert found.uniform is not None
    late = resume(replace(found, uniform=delay_sensor(found.uniform, "foot_l", 0.05)), "agreement")
    tracks, strides = late.tracks, late.strides
    assert tracks is not None
    assert strides is not None
    assert [x.notice.code for x in tracks.doubts] == [LATE_FOOT]
    stride = strides.strides[4]
    middle = 0.5 * (stride.start_s + stride.end_s)
    edited = measure_gait(tracks, [Edit("exclude_stride", stride.side, middle, reason="test")])
    assert LATE_FOOT in {p.reason for p in edited.parameters}


def test_nothing_is_judged_without_a_walk() -> None:
    recording = walk("healthy").recording
    assert judge_sensors(recording, replace(walk("healthy").contacts.events, events=()), ()) == ()  # type: ignore[union-attr]
