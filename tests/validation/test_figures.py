"""Figures are recorded, compared with the last report and merged into the next one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from validation import figures
from validation.figures import find_differences, judge_goal, record, record_goal, record_in_short
from validation.report import UnitResult, list_differences, merge_figures, write_report

ROW = "| hip flexion | 2.4/3.3 | 0.989 | −1.0 |"


@pytest.mark.parametrize("other", ["| hip flexion | 2.4/3.2 | 0.990 | −0.9 |", ROW])
def test_a_last_digit_may_round_differently(other: str) -> None:
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
def test_a_different_figure_or_word_is_reported(other: str) -> None:
    assert find_differences(ROW, other) == [f"- {ROW}", f"+ {other}"]


def test_an_additional_row_is_reported() -> None:
    assert find_differences(ROW, f"{ROW}\n{ROW}") == ["- ", f"+ {ROW}"]


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File that figures are stored in; the last report has one section."""
    path = tmp_path / "figures"
    printed = "| a | b |\n| --- | --- |\n| one | 1.0 |\n| two | 2.0 |\n\nA note."
    monkeypatch.setenv(figures.STORE, str(path))
    monkeypatch.setattr(figures, "read_sections", lambda: {"Some": printed})
    return path


def stored(path: Path) -> list[dict[str, str]]:
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()]


def test_a_section_is_stored_and_compared(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record("Some", ["a", "b"], [["one", "1.0"], ["two", "2.5"]], "A note.")
    assert "+ | two | 2.5 |" in capsys.readouterr().out
    (line,) = stored(store)
    assert line["kind"] == "section"
    assert line["text"].endswith("| two | 2.5 |\n\nA note.")


def test_some_rows_are_compared_with_their_own(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record("Some", ["a", "b"], [["two", "2.0"]], "Another.", whole=False)
    assert capsys.readouterr().out == ""
    assert stored(store)[0]["kind"] == "rows"
    assert merge_figures({"Some": "kept"}, stored(store)) == {"Some": "kept"}


def test_nothing_is_stored_unless_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(figures.STORE, raising=False)
    record("Some", ["a"], [["1"]])
    assert list(tmp_path.iterdir()) == []


def test_a_row_replaces_its_predecessor_and_keeps_its_place(store: Path) -> None:
    record_goal("a", 1.0, 0.5, "s")
    record_goal("b", 1.0, 2.0, "s")
    record_goal("a", 1.0, 1.5, "s")
    text = merge_figures({}, stored(store))[figures.GOALS]
    assert text.splitlines()[2:] == ["| a | ≤ 1 s | 1.5 s | no |", "| b | ≤ 1 s | 2 s | no |"]


def test_a_goal_is_met_or_not() -> None:
    assert judge_goal("page", 12.5, 11.04, "ms") == ("page", "≤ 12.5 ms", "11 ms", "yes")
    assert judge_goal("page", 12.5, 14.04, "ms")[-1] == "no"
    assert judge_goal("text", 200.0, 173.2, "MB/s", at_least=True)[1:] == ("≥ 200 MB/s", "173 MB/s", "no")


def test_key_figures_are_declared(store: Path) -> None:
    with pytest.raises(ValueError, match="KEY_FIGURES"):
        record_in_short("Another figure", "–", "1", "nothing")
    assert not store.exists()


def result_of(figure: dict[str, str]) -> UnitResult:
    return UnitResult("unit", "failed", "1 failed", 60.0, "code", "2026-01-01T00:00:00", True, [figure])


def test_the_report_states_what_changed_and_what_failed(tmp_path: Path) -> None:
    report, accuracy = tmp_path / "report.md", tmp_path / "accuracy.md"
    report.write_text("# Old\n\n## Some\n\n| a |\n| --- |\n| 1.0 |\n\n## Other\n\nkept\n", encoding="utf-8")
    changed = {"kind": "section", "section": "Some", "text": "| a |\n| --- |\n| 2.0 |"}
    row = {"kind": "row", "section": figures.IN_SHORT, "text": "| figure | ours |\n| Stride time ms | 1 |"}
    write_report([result_of(changed), result_of(row)], report, accuracy)
    text = report.read_text("utf-8")
    assert "- | 1.0 |\n+ | 2.0 |" in text
    assert "- `unit`: 1 failed" in text
    assert "## Other\n\nkept" in text
    assert "| Stride time ms | 1 |" in accuracy.read_text("utf-8")
    # the same figures again: no difference, and what was generated is not compared
    write_report([result_of(changed)], report, accuracy)
    assert "## Differences from the previous report\n\nNone." in report.read_text("utf-8")


@pytest.mark.slow
def test_speed_is_not_compared() -> None:
    assert list_differences({"Speed: a": "1"}, {"Speed: a": "2", "Some": "1"}) == "New section: Some."
