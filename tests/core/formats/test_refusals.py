"""Explanations of uploads without a recording."""

from __future__ import annotations

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats.refusals import MOST_SHOWN, explain_manifest, explain_unreadable


def test_files_with_one_cause_are_explained_once() -> None:
    names = ("a.csv", "b.csv", "c.csv")
    problems = [(name, FormatError("empty", f"{name} is empty; copy it again.")) for name in names]
    error = explain_unreadable(problems, [])
    assert error.code == "empty"
    assert error.message == "a.csv is empty; copy it again. The same holds of 2 other files."


def test_different_causes_are_listed_and_the_rest_is_counted() -> None:
    problems = [(f"{k}.csv", FormatError(f"cause_{k}", f"cause {k}.")) for k in range(MOST_SHOWN + 2)]
    error = explain_unreadable(problems, [Notice("ignored_file", "x.pdf was not used.")])
    assert error.code == "unknown_format"
    assert "cause 0." in error.message
    assert error.message.endswith("… and 3 more.")


def test_a_table_is_named_with_its_first_line() -> None:
    assert "walk.csv is a table that starts with 'a,b,c'" in explain_manifest("walk.csv", b"a,b,c\n1,2,3\n")
