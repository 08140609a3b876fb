"""Trials whose sensors have hardly any sample in common end in results or a notice, never in an exception."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.angles.measure import measure_angles
from sagittal.core.errors import SagittalError
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.pipeline import analyse
from sagittal.core.signals.recording import Subject
from sagittal.server.report.files.exports import analysis_files
from tests.core.pipeline.lossy_trials import LossyTrial, draw_trial, keep_segments, lose_samples, walk

EVERYDAY = range(24)
WIDE = range(1000, 2000)

OURS = ("stage_not_reached", "bad_shape")
"""Codes of a fault of the chain itself: no recording has it."""


def analyse_strictly(trial: LossyTrial) -> str:
    """How the analysis ends: "results", the code of its problem, or of the refusal; a warning fails.

    Files are written as well: what an analysis lacks must not stop them.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            analysis = analyse(trial.recording, trial.config, resumable=trial.resumable)
        except SagittalError as refusal:
            return refusal.code
        assert "analysis.json" in analysis_files(analysis)
    if analysis.problem is not None:
        assert analysis.problem.code not in OURS, analysis.problem
        return analysis.problem.code
    assert analysis.parameters or analysis.notices
    return "results"


def end_of(seed: int) -> str:
    trial = draw_trial(seed)
    try:
        return analyse_strictly(trial)
    except Exception as error:
        error.add_note(trial.name)
        raise


@pytest.mark.slow
def test_trials_with_lost_samples_end_in_results_or_a_notice() -> None:
    ends = Counter(end_of(seed) for seed in EVERYDAY)
    assert ends["results"] > 5
    assert len(ends) > 2


@pytest.mark.sweep
@pytest.mark.parametrize("first", range(WIDE.start, WIDE.stop, 100))
def test_many_trials_with_lost_samples_end_in_results_or_a_notice(first: int) -> None:
    for seed in range(first, first + 100):
        end_of(seed)


def test_feet_that_never_measure_at_the_same_time_are_named() -> None:
    result = keep_segments(walk(), ("foot_l", "foot_r"))
    device, second = result.streams
    n = len(result.streams[device].t_s)
    early = np.arange(n) < 0.4 * n
    halves = {
        device: lose_samples(result.streams[device], early, "both"),
        second: lose_samples(result.streams[second], np.arange(n) > 0.6 * n, "both"),
    }
    analysis = analyse(replace(result, streams=halves, subject=Subject()))
    assert analysis.angles is None or not analysis.angles.angles
    assert {n.sensor for n in analysis.notices} >= {"foot_l"}


def test_no_segments_have_no_angles() -> None:
    nothing = Orientations(np.linspace(0.0, 0.1, 11), 100.0, {}, {}, "none")
    angles = measure_angles(nothing, (0.0, 0.05))
    assert not angles.angles
    assert {n.code for n in angles.notices} == {"joint_missing"}
