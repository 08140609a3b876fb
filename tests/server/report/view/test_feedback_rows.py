"""A row of a feedback table, and differences with their sign."""

from __future__ import annotations

import pytest

from sagittal.core.feedback.cue import Summary
from sagittal.server.report.view.feedback_rows import NO_STRIDES, describe_summary, format_signed
from sagittal.server.report.words.feedback_words import NBSP
from sagittal.server.report.words.wording import parameter_term

METRES = parameter_term("step_length_m")


def test_a_row_has_mean_spread_and_share_in_words_and_as_numbers() -> None:
    row = describe_summary("with", "With feedback", True, Summary(12, 0.5234, 0.031, 0.656), 2)
    assert (row.text, row.zone) == ("0.52 ± 0.03", f"66{NBSP}%")
    assert (row.kind, row.label, row.part, row.n) == ("with", "With feedback", True, 12)
    assert (row.mean, row.sd, row.in_zone) == (0.5234, 0.031, 0.656)


def test_a_single_stride_has_no_spread() -> None:
    assert describe_summary("probe", "probe", False, Summary(1, 0.5, None, 0.0), 2).text == "0.50"
    assert describe_summary("probe", "probe", False, Summary(1, 0.5, None, 0.0), 2).zone == f"0{NBSP}%"


def test_without_strides_there_is_a_dash() -> None:
    row = describe_summary("with", "With feedback", False, Summary(), 2)
    assert (row.text, row.zone, row.n) == (NO_STRIDES, NO_STRIDES, 0)


@pytest.mark.parametrize(
    ("value", "text"), [(0.02, "+0.02"), (-0.02, "−0.02"), (0.004, "0.00"), (-0.004, "0.00"), (0.0, "0.00")]
)
def test_a_difference_has_a_sign_unless_it_rounds_to_nothing(value: float, text: str) -> None:
    assert format_signed(value, METRES) == f"{text}{NBSP}m"
