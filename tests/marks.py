"""Which cases of a test run: in every run, in a long one, or where figures are written."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Final, TypeVar

import pytest

from tests.accuracy.report import WRITE

T = TypeVar("T")

WRITES: Final = WRITE in os.environ
"""Whether figures are written: then every case is run."""

about_the_file = pytest.mark.skipif(
    "config.getoption('--engine') == 'postgresql'", reason="about the file that SQLite has"
)

where_figures_are_written = pytest.mark.skipif(not WRITES, reason="minutes more: run with --write-figures")
"""Figures that cost more than they tell from one change to the next; limits stand in other tests."""


def slow_beyond(usual: int, cases: Sequence[Any]) -> list[Any]:
    """Cases of a test of which only the first few run in every run; the others are slow."""
    slow = [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow)
        for case in cases[usual:]
    ]
    return [*cases[:usual], *slow]


def sample(cases: Sequence[T], one_in: int, first: int = 0) -> list[T]:
    """Every so many of the cases, from the first one named; all of them where figures are written."""
    return list(cases if WRITES else cases[first % min(one_in, len(cases)) :: one_in])
