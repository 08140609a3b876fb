"""After the take: each cue finds its stride, and strides with and without feedback are summed up apart."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sagittal.core.feedback import AnalysedStride, Cue, split
from sagittal.core.feedback.summary import TOLERANCE_S
from tests.helpers.feedback import prescription, train

BLOCKS = {"kind": "every", "probe_every": 10, "probe_strides": 5}


def analysed(cues: list[Cue]) -> list[AnalysedStride]:
    return [AnalysedStride(c.side, c.start_s + 0.02, c.value, counted=True) for c in cues]


def test_strides_are_split_by_what_the_person_was_told() -> None:
    cues, _ = train([0.45] * 10 + [0.40] * 5 + [0.50] * 10, prescription(schedule=BLOCKS))
    parts = split(analysed(cues), cues)
    assert parts.kinds["with"].n == 20
    assert parts.kinds["with"].mean == pytest.approx(0.475)
    assert parts.kinds["without"] == parts.kinds["probe"]
    assert [parts.kinds["probe"].n, parts.kinds["probe"].mean] == pytest.approx([5, 0.40])
    assert parts.kinds["probe"].in_zone == 1.0
    block = parts.probes[0]
    assert (block.number, block.before.n) == (1, 5)
    assert block.before.mean == pytest.approx(0.45)
    assert parts.end.mean == pytest.approx(0.475)
    assert (parts.unmatched, parts.left_out) == (0, 0)


def test_the_values_are_those_of_the_analysis_and_the_difference_is_told() -> None:
    cues, _ = train([0.45, 0.47])
    strides = [replace(s, value=(s.value or 0.0) - 0.02) for s in analysed(cues)]
    parts = split(strides, cues)
    assert parts.kinds["with"].mean == pytest.approx(0.44)
    assert parts.live_difference.mean == pytest.approx(0.02)


def test_a_cue_takes_the_nearest_stride_of_its_side_once() -> None:
    cues, _ = train([0.45])
    start = cues[0].start_s
    target = AnalysedStride("left", start + TOLERANCE_S, 0.46, counted=True)
    assert split([target], cues).strides[0].value == 0.46
    assert split([replace(target, side="right")], cues).unmatched == 1
    assert split([replace(target, start_s=start + TOLERANCE_S + 0.001)], cues).unmatched == 1
    second_variant = replace(cues[0], n=1)
    assert split([target], [cues[0], second_variant]).unmatched == 1
    assert split([target], [cues[0], cues[0]]).unmatched == 0, "a cue that was written down twice is one"


def test_strides_that_do_not_count_in_the_analysis_are_left_out_and_counted() -> None:
    cues, _ = train([0.45, 0.46, 0.47])
    strides = analysed(cues)
    strides[0] = replace(strides[0], counted=False)
    strides[1] = replace(strides[1], value=None)
    parts = split(strides, cues)
    assert (parts.kinds["with"].n, parts.left_out) == (1, 2)


def test_the_course_of_the_level_has_its_beginning_and_every_change() -> None:
    cues, _ = train([0.6] * 61)
    parts = split(analysed(cues), cues)
    assert [(s.n, s.level) for s in parts.levels] == [(0, 3), (40, 2), (80, 1), (120, 0)]


def test_without_cues_there_is_nothing() -> None:
    parts = split([AnalysedStride("left", 0.0, 0.4, counted=True)], [])
    assert (parts.strides, parts.kinds, parts.probes, parts.levels) == ((), {}, (), ())
    assert parts.end.mean is None
