"""Dates and times of day as texts → seconds.

Read are ISO 8601 with and without zone and its relatives: "2024-02-07 11:27:27.350",
"2024-02-07T11:27:27,350+01:00", "2024-02-07 11:27:27:350" (GENEActiv), "2024-02-07T11.27.27.350"
(MetaMotion), "20240207_112727.350", "7.2.2024 11:27:27", "2/7/2024 11:27:27 AM", "7-Feb-2024 11:27:27",
"11:27:27.350", "[2024-02-07 11:27:27]". Whether the month or the day comes first is decided by all rows.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute

from sagittal.core.frames import Floats

pc: Any = pyarrow.compute
"""Its stubs know no overload for many of these calls."""
_TIME: Final = (
    r"(?P<hour>\d{1,2})[:.h]?(?P<minute>\d{2})(?:[:.m]?(?P<second>\d{2})(?:[.,:](?P<fraction>\d{1,9}))?)?s?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?"
    r"\s*(?:\[[A-Za-z/_]+\])?(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2}|[+-]\d{2})?\s*(?:\[[A-Za-z/_]+\])?"
)
_OF_DAY: Final = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[.,:](?P<fraction>\d{1,9}))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?"
)
_YEAR_FIRST: Final = r"(?P<a>\d{4})[-/.]?(?P<b>\d{2})[-/.]?(?P<c>\d{2})"
_YEAR_LAST: Final = r"(?P<a>\d{1,2})[-/.](?P<b>\d{1,2})[-/.](?P<c>\d{2,4})"
_NAMED: Final = r"(?P<a>\d{1,2})[-\s](?P<b>[A-Za-z]{3})[a-z]*[-\s,]+(?P<c>\d{2,4})"
_AMERICAN: Final = r"(?:[A-Za-z]{3}[a-z]*,?\s+)?(?P<b>[A-Za-z]{3})[a-z]*\s+(?P<a>\d{1,2}),?\s+(?P<c>\d{4})"
_BETWEEN: Final = r"[T\s_,;-]+"
_OPEN, _CLOSE = r"^\s*[\[\"']?", r"[\]\"']?\s*$"
_PATTERNS: Final = (
    ("ymd", _OPEN + _YEAR_FIRST + _BETWEEN + _TIME + _CLOSE),
    ("dmy", _OPEN + _YEAR_LAST + _BETWEEN + _TIME + _CLOSE),
    ("named", _OPEN + _NAMED + _BETWEEN + _TIME + _CLOSE),
    ("named", _OPEN + _AMERICAN + _BETWEEN + _TIME + _CLOSE),
    ("time", _OPEN + _OF_DAY + _CLOSE),
)
_MONTHS: Final = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_LEAST: Final = 0.5
"""Share of the texts that a pattern must read."""


def looks_like_time(cell: str) -> bool:
    """Whether a text is a date with a time, or a time of day."""
    return _choose(pa.array([cell])) is not None


def parse_times(column: pa.ChunkedArray[Any] | pa.Array[Any]) -> Floats:
    """Seconds of a column of texts (n,), NaN where one is no time: since 1970 with a date, else of the day.

    Times without a zone are interpreted as UTC.
    """
    texts = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    chosen = _choose(texts.slice(0, 200))
    if chosen is None:
        return np.full(len(texts), np.nan)
    kind, pattern = chosen
    matches = pc.extract_regex(texts, pattern)
    parts = {f.name: pc.struct_field(matches, f.name) for f in matches.type}
    hour, minute, second = (_number(parts[name]) for name in ("hour", "minute", "second"))
    seconds = _halves(hour, parts["half"]) * 3600.0 + minute * 60.0 + np.nan_to_num(second)
    seconds = seconds + _fraction(parts["fraction"])
    if kind == "time":
        return seconds
    return _days(kind, parts) * 86_400.0 + seconds - _zone(parts["zone"])


def _choose(texts: pa.Array[Any]) -> tuple[str, str] | None:
    """The pattern that reads most of some texts."""
    non_null = texts.drop_null()
    if not len(non_null):
        return None
    best, most = None, _LEAST * len(non_null)
    for kind, pattern in _PATTERNS:
        count = pc.sum(pc.match_substring_regex(non_null, pattern)).as_py() or 0
        if count > most:
            best, most = (kind, pattern), count
    return best


def _number(part: pa.Array[Any]) -> Floats:
    """Digits as numbers, NaN for none."""
    digits = pc.if_else(pc.equal(part, ""), None, part)
    return np.asarray(pc.cast(digits, pa.float64()).to_numpy(zero_copy_only=False), np.float64)


def _fraction(part: pa.Array[Any]) -> Floats:
    length = np.asarray(pc.fill_null(pc.utf8_length(part), 0).to_numpy(zero_copy_only=False), np.float64)
    return np.nan_to_num(_number(part)) / 10.0**length


def _halves(hour: Floats, half: pa.Array[Any]) -> Floats:
    """Hours of the day from those of a 12-hour clock."""
    first = pc.utf8_lower(pc.utf8_slice_codeunits(half, 0, 1))
    is_pm = np.asarray(pc.fill_null(pc.equal(first, "p"), False).to_numpy(zero_copy_only=False), np.bool_)
    is_am = np.asarray(pc.fill_null(pc.equal(first, "a"), False).to_numpy(zero_copy_only=False), np.bool_)
    return np.where(is_pm & (hour < 12), hour + 12, np.where(is_am & (hour == 12), 0.0, hour))


def _zone(part: pa.Array[Any]) -> Floats:
    """Seconds by which a zone is ahead of UTC; 0 without one."""
    matches = pc.extract_regex(part, r"^(?P<sign>[+-])(?P<hours>\d{2}):?(?P<minutes>\d{2})?$")
    hours = np.nan_to_num(_number(pc.struct_field(matches, "hours")))
    minutes = np.nan_to_num(_number(pc.struct_field(matches, "minutes")))
    minus = pc.fill_null(pc.equal(pc.struct_field(matches, "sign"), "-"), False).to_numpy(
        zero_copy_only=False
    )
    return np.where(np.asarray(minus, np.bool_), -1.0, 1.0) * (hours * 3600.0 + minutes * 60.0)


def _days(kind: str, parts: dict[str, pa.Array[Any]]) -> Floats:
    """Days since 1970 of every row, NaN where a date does not exist."""
    if kind == "named":
        lower = pc.utf8_lower(parts["b"])
        month = (
            np.asarray(pc.index_in(lower, pa.array(_MONTHS)).to_numpy(zero_copy_only=False), np.float64) + 1
        )
        year, day = _number(parts["c"]), _number(parts["a"])
    else:
        a, b, c = (_number(parts[name]) for name in "abc")
        if kind == "ymd":
            year, month, day = a, b, c
        else:  # 7/2 is the seventh of February unless some second number is no month
            american = bool(np.nanmax(b, initial=0.0) > 12)
            year, month, day = c, (a if american else b), (b if american else a)
    year = np.where(year < 100, year + 2000, year)
    good = np.isfinite(year + month + day) & (month >= 1) & (month <= 12) & (day >= 1) & (day <= 31)
    months = np.where(good, (year - 1970) * 12 + month - 1, 0).astype(np.int64)
    days = (
        months.astype("datetime64[M]").astype("datetime64[D]").astype(np.float64) + np.where(good, day, 1) - 1
    )
    return np.where(good, days, np.nan)
