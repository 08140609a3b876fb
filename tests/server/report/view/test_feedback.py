"""The section of feedback: kinds of strides, probes, levels and notes in words."""

from __future__ import annotations

import pytest

from sagittal.core.events.result import Stride, Strides
from sagittal.core.feedback import AnalysedStride, Cue, FeedbackSplit, GuardState, split
from sagittal.core.feedback.cue import WhyNot
from sagittal.server.report.view.feedback import FeedbackView, feedback_view, list_analysed_strides
from sagittal.server.report.words.feedback_words import NBSP
from tests.helpers.feedback import prescription


def cue(n: int, why_not: WhyNot | None = None, value: float = 0.62, block: int | None = None) -> Cue:
    visible_rows = why_not is None
    return Cue(
        n, "left", float(n), n + 1.0, value, 0.0, "in", visible_rows, why_not, 1, 0.5, 0.7, None, block
    )


def take(cues: list[Cue], values: list[float]) -> FeedbackSplit:
    strides = [AnalysedStride("left", c.start_s, v, True) for c, v in zip(cues, values, strict=True)]
    return split(strides, cues)


def view(result: FeedbackSplit) -> FeedbackView:
    return feedback_view(prescription(), result, GuardState())


TRAINED = take(
    [cue(1), cue(2), cue(3, "probe", block=1), cue(4, "faded")],
    [0.60, 0.62, 0.80, 0.64],
)


def test_strides_with_and_without_feedback_are_apart_and_parts_follow_their_whole() -> None:
    rows = view(TRAINED).rows
    assert [(r.kind, r.part, r.n) for r in rows] == [
        ("with", False, 2), ("without", False, 2), ("probe", True, 1), ("faded", True, 1)
    ]  # fmt: skip
    assert rows[0].text == "0.61 ± 0.01"
    assert rows[2].zone == f"0{NBSP}%"


def test_a_take_without_a_stride_still_says_how_many_and_draws_nothing() -> None:
    visible_view = view(split([], []))
    assert [(r.kind, r.n, r.text) for r in visible_view.rows] == [("with", 0, "–"), ("without", 0, "–")]
    assert visible_view.svg == ""
    assert view(TRAINED).svg.startswith("<div")


def test_a_probe_stands_beside_the_strides_right_before_it() -> None:
    (probe,) = view(TRAINED).probes
    assert (probe.number, probe.start_s) == (1, 3.0)
    assert [probe.before.mean, probe.probe.mean] == pytest.approx([0.62, 0.80])


def test_notes_say_how_far_the_live_values_were_off_and_what_was_left_out() -> None:
    mode, side_effects, live = view(take([cue(1), cue(2)], [0.60, 0.60])).notes
    assert mode.startswith("Values are from the completed analysis")
    assert side_effects == "Side effects: the last 20 strides vs the first 10 of the trial."
    assert live == f"Live feedback values differed from the analysis by 0.020 ± 0.000{NBSP}m."
    few = split([AnalysedStride("left", 2.0, 0.6, False)], [cue(1), cue(2), cue(3)])
    assert view(few).notes[2:] == (
        "2 cues were excluded because they have no stride in the analysis.",
        "1 cue was excluded because its stride is excluded from the analysis.",
    )


def test_json_has_every_stride_with_the_value_of_the_analysis_and_the_live_one() -> None:
    result = view(TRAINED).to_json()
    strides = result["strides"]
    assert isinstance(strides, list)
    assert [(s["n"], s["value"], s["live_value"], s["in_zone"]) for s in strides] == [
        (1, 0.60, 0.62, True), (2, 0.62, 0.62, True), (3, 0.80, 0.62, False), (4, 0.64, 0.62, True)
    ]  # fmt: skip
    assert (result["parameter"], result["unit"], result["side"]) == ("step_length_m", "m", "left")
    assert result["levels"] == [{"n": 1, "t_s": 1.0, "level": 1}]
    assert result["retention"] is None
    words = result["words"]
    assert isinstance(words, list)
    assert words[0] == "Trained: Step length, left"


def test_without_an_earlier_training_there_is_no_retention_to_tell() -> None:
    visible_view = view(TRAINED)
    assert (visible_view.retention, visible_view.retention_words) == (None, "")
    assert visible_view.title == "Step length, left"
    assert visible_view.target == f"0.60 ± 0.05{NBSP}m, entered"


def test_the_stride_list_takes_the_value_of_the_trained_parameter_and_whether_it_counts() -> None:
    walked = (
        Stride("left", 1.0, 1.6, 2.0, None, None, 0.0, None),
        Stride("right", 1.5, 2.1, 2.5, None, None, 0.0, "turn"),
    )
    assert list_analysed_strides(Strides(walked), (0.6, None)) == (
        AnalysedStride("left", 1.0, 0.6, True),
        AnalysedStride("right", 1.5, None, False),
    )
