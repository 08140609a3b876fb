"""Sentences about repaired clocks."""

from __future__ import annotations

from sagittal.core.formats.clocks import report


def test_a_repair_says_what_where_and_how_much() -> None:
    one = report.describe_leap(2599, 3600.0, "the clock was set")
    assert (
        one.message
        == "From row 2600 on, all times are 3600 s later (the clock was set); this jump was removed."
    )
    assert report.describe_wrong(1, 0, 0.65).message.startswith(
        "1 row has a wrong time stamp, up to 0.65 s off"
    )
    assert report.describe_wrong(3, 0, 0.65).message.startswith("3 rows have")


def test_a_restart_and_constant_stamps_are_refused_with_their_cause() -> None:
    restart = report.refuse_restart("a.csv", "x", 99, 200, 1.0)
    assert restart.code == "counter_restart"
    assert "row 100 of 200" in restart.message
    constant = report.refuse_constant("a.csv", "x", 5191, 1, 1.7e9)
    assert constant.code == "time_constant"
    assert "spreadsheet" in constant.message
    assert "counter" in report.refuse_constant("a.csv", "x", 5191, 1, float("nan")).message
