"""The profile on the first sheet of paper."""

from __future__ import annotations

from typing import Any

from server.pages.first_sheet import MOST_CHARACTERS, has_room_for_profile
from server.report.headline import Headline, HeadlineSentence


def test_the_profile_stands_on_the_first_sheet_where_it_has_room() -> None:
    long = HeadlineSentence("gait_speed_mps", None, "speed", "norm", 2.0, "x" * 60, "y", "", "the norm")
    report: dict[str, Any] = {"score": {}, "bars": [{}] * 4, "since": None}
    report["headline"] = Headline("Good", (long,) * 5)
    assert has_room_for_profile(report, "x" * MOST_CHARACTERS, "Short note")
    assert not has_room_for_profile(report, "x" * (MOST_CHARACTERS + 1), "")
    assert not has_room_for_profile(report, "a\n\nb\n\nc\n\nd", "")
    assert not has_room_for_profile(report, "", "x" * 400)
    assert not has_room_for_profile(report | {"score": None}, "", "")
    # with a column of changes the rows of the table take two lines
    assert not has_room_for_profile(
        report | {"since": object(), "headline": Headline("Good", (long,) * 6)}, "", "Note"
    )
