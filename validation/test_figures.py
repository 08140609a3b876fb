"""The check of the check: a figure that is not the printed one is found, one that rounds otherwise is not."""

from __future__ import annotations

import pytest

from validation.accuracy import report
from validation.figures import find_differences, read_sections, record

ROW = "| hip flexion | 2.4/3.3 | 0.989 | −1.0 |"


@pytest.mark.parametrize("other", ["| hip flexion | 2.4/3.2 | 0.990 | −0.9 |", ROW])
def test_a_last_digit_may_round_otherwise(other: str) -> None:
    assert find_differences(ROW, other) == []


@pytest.mark.parametrize(
    "other",
    [
        ROW.replace("2.4", "2.6"),
        ROW.replace("hip", "knee"),
        ROW.replace("−1.0", "+1.0"),
        ROW.replace("2.4/3.3", "2.4"),
        "",
    ],
)
def test_a_figure_or_word_that_differs_is_found(other: str) -> None:
    assert find_differences(ROW, other) == [f"- {ROW}", f"+ {other}"]


def test_a_row_more_is_found() -> None:
    assert find_differences(ROW, f"{ROW}\n{ROW}") == ["- ", f"+ {ROW}"]


def test_a_section_that_is_not_there_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(report.WRITE, raising=False)
    if "Nowhere" in read_sections():
        pytest.fail("the name is taken")
    with pytest.raises(AssertionError, match="has no section 'Nowhere'"):
        record("Nowhere", ["a"], [["1"]])


def test_some_rows_are_held_against_their_own_and_the_rest_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(report.WRITE, raising=False)
    printed = "| a | b |\n| --- | --- |\n| one | 1.0 |\n| two | 2.0 |\n| three | 3.0 |\n\nA note."
    monkeypatch.setattr(report, "read_sections", lambda: {"Some": printed})
    record("Some", ["a", "b"], [["one", "1.0"], ["three", "3.1"]], "Another.", whole=False)
    for wrong in (["three", "3.2"], ["four", "4.0"]):
        with pytest.raises(AssertionError, match=wrong[1]):
            record("Some", ["a", "b"], [["one", "1.0"], wrong], whole=False)
    # a row without a first cell is one more of the row above
    printed = "| a | b |\n| --- | --- |\n| one | 1.0 |\n|  | 1.5 |\n| two | 2.0 |\n|  | 2.5 |"
    record("Some", ["a", "b"], [["two", "2.0"], ["", "2.5"]], whole=False)
    for some in ([["two", "2.0"], ["", "2.8"]], [["two", "2.0"]], [["one", "1.0"], ["", "2.5"]]):
        with pytest.raises(AssertionError, match="Some"):
            record("Some", ["a", "b"], some, whole=False)
    monkeypatch.setenv(report.WRITE, "1")
    with pytest.raises(AssertionError, match="would lose"):
        record("Some", ["a", "b"], [["one", "1.0"]], whole=False)


def test_nothing_is_written_without_being_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(report.WRITE, raising=False)
    before = report.PATH.read_bytes()
    section, body = next(iter(read_sections().items()))
    with pytest.raises(AssertionError, match=section):
        record(section, ["figure"], [["no such thing"]])
    assert report.PATH.read_bytes() == before
    assert body
