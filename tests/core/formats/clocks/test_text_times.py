"""Dates and times of day as text."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from sagittal.core.formats.clocks.text_times import looks_like_time, parse_times

NOON = 1707305247.35


@pytest.mark.parametrize(
    ("cell", "seconds"),
    [
        ("2024-02-07 11:27:27.350", NOON),
        ("2024-02-07T12:27:27,350+01:00", NOON),
        ("2024-02-07T11:27:27.350Z", NOON),
        ("2024-02-07 11:27:27:350", NOON),
        ("2024-02-07T11.27.27.350", NOON),
        ("20240207_112727.350", NOON),
        ("7.2.2024 11:27:27,350", NOON),
        ("07/02/2024 11:27:27.350 AM", NOON),
        ("07-Feb-2024 11:27:27.350", NOON),
        ("Feb 7, 2024, 11:27:27.350 AM", NOON),
        ("2024-02-07T12:27:27.350+0100 [Europe/Berlin]", NOON),
        ("[2024-02-07 11:27:27.350]", NOON),
        ("11:27:27.350", 41247.35),
        ("1:05:00 PM", 47100.0),
    ],
)
def test_forms_that_loggers_write_are_read(cell: str, seconds: float) -> None:
    assert looks_like_time(cell)
    np.testing.assert_allclose(parse_times(pa.array([cell])), [seconds])


@pytest.mark.parametrize("cell", ["0.01", "1.23", "-0.12", "123456", "1,70000E+15", "2024-02-07", "left"])
def test_numbers_and_words_are_no_times(cell: str) -> None:
    assert not looks_like_time(cell)


def test_all_rows_decide_whether_the_month_comes_first() -> None:
    american = parse_times(pa.array(["2/7/2024 23:59:59", "2/8/2024 00:00:00", "2/28/2024 00:00:00", None]))
    assert american[1] - american[0] == 1.0
    assert (american[2] - american[1]) / 86400 == 20
    assert np.isnan(american[3])
