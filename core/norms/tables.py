"""The reference tables shipped as package data, read once. Origin and licence of each: data/SOURCES.md."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from operator import itemgetter

WBDS = "Fukuchi, Fukuchi & Duarte 2018 (PeerJ 6:e4640), WBDS data set, CC BY 4.0"
"""Source line of everything computed from the WBDS strides; printed wherever a norm is shown."""

WBDS_N: Mapping[str, int] = {"adult_21_84": 42, "adult_21_54": 25, "adult_55_84": 17}
"""Subjects per age group of the WBDS tables."""

LEVEL = "The level depends on the protocol: published data sets differ by up to 5° at the hip and knee."
"""Said wherever the level of an angle is compared (WBDS against Schwartz et al. 2008)."""

ADULT_AGE = 18.0
"""Below it no adult table applies (the tables start at 21; 18 to 20 use all adults)."""


@cache
def read_rows(name: str) -> tuple[Mapping[str, str], ...]:
    """Rows of one table by column name."""
    header, *rows = _read_cells(name)
    return tuple(dict(zip(header, row, strict=True)) for row in rows)


def read_columns(name: str, *columns: str) -> Iterator[tuple[str, ...]]:
    """Some columns of one table, row by row; for a large table this needs less memory than all rows by
    name.
    """
    rows = _read_cells(name)
    header = next(rows)
    return map(itemgetter(*map(header.index, columns)), rows)


def _read_cells(name: str) -> Iterator[list[str]]:
    text = files("sagittal.core.norms").joinpath("data", f"{name}.csv").read_text(encoding="utf-8")
    return csv.reader(text.splitlines())


def wbds_group(age: float | None) -> str | None:
    """WBDS age group of a person; all adults for an unknown age, None below 18 years."""
    if age is None:
        return "adult_21_84"
    if age < ADULT_AGE:
        return None
    if age < 21:
        return "adult_21_84"
    return "adult_21_54" if age < 55 else "adult_55_84"
