"""Numbers, dates and sizes as the pages write them."""

from __future__ import annotations

import datetime as dt
import re

import pytest

from sagittal.core.pipeline import WALK
from sagittal.core.pipeline.recipes import ACTIVITY
from sagittal.server.pages.results.data import FILE_WORDS
from sagittal.server.pages.results.session_context import STAGE_NAMES, STAGES_OF_DAYS
from sagittal.server.report.files import activity_files, exports
from sagittal.web.words import day, filesize, moment, number, pattern, seconds


@pytest.mark.parametrize(
    ("size", "text"),
    [(0, "0 B"), (999, "999 B"), (1500, "1.5 kB"), (18_400_000, "18.4 MB"), (2.5e9, "2.5 GB")],
)
def test_sizes(size: float, text: str) -> None:
    assert filesize(size) == text


def test_numbers_have_a_real_minus_no_negative_zero_and_a_dash_for_none() -> None:
    assert number(-1.25, 1) == "−1.2"
    assert number(-0.04, 1) == "0.0"
    assert number(None) == "–"


def test_times_are_said_in_utc() -> None:
    east = dt.timezone(dt.timedelta(hours=2))
    assert moment(dt.datetime(2026, 11, 18, 1, 5, tzinfo=east)) == "17 Nov 2026, 23:05"
    assert day(dt.date(2026, 3, 1)) == "1 Mar 2026"
    assert (seconds(42.61), seconds(119.6), seconds(185), seconds(None)) == (
        "42.6 s",
        "120 s",
        "3 min 5 s",
        "–",
    )


@pytest.mark.parametrize("code", ["P-0042", "a.b+c", "(x)", "ü ß", "a&b"])
def test_a_code_as_a_pattern_matches_itself_only(code: str) -> None:
    assert re.fullmatch(pattern(code), code)
    assert not re.fullmatch(pattern(code), code + "x")


def test_every_result_file_has_words_on_the_data_page() -> None:
    documented = f"{exports.__doc__}\n{activity_files.__doc__}"
    matches = re.findall(r"^([a-z_]+\.(?:json|parquet|csv)) ", documented, re.MULTILINE)
    assert len(matches) >= 8
    assert set(FILE_WORDS) == set(matches)


def test_every_stage_of_the_pipeline_has_words_in_its_order() -> None:
    assert list(STAGE_NAMES) == ["reading", *(stage.name for stage in WALK)]
    assert list(STAGES_OF_DAYS) == ["reading", *(stage.name for stage in ACTIVITY)]
