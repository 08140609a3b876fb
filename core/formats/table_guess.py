"""Probable content of an unknown table: layout, clock, signals, units, as an entry of `sources` to confirm.

Only its beginning is read, whatever its length.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sagittal.core.errors import FormatError, InputError, ManifestError
from sagittal.core.formats import table, text
from sagittal.core.formats._sniff import sniff
from sagittal.core.formats.aliases import segment_in
from sagittal.core.formats.archive import expand, is_gzip, is_zip
from sagittal.core.formats.draft import Draft
from sagittal.core.formats.source import SourceFile, stem_of
from sagittal.core.formats.source_spec import ACC_UNITS, GYR_UNITS, TIME_UNITS, SourceSpec
from sagittal.core.formats.tables.column_names import is_time_name, names_quantity, read_file_kind, read_name
from sagittal.core.formats.tables.header import find_titles
from sagittal.core.formats.tables.layout import LINES, find_layout
from sagittal.core.formats.tables.time_unit import find_tick, measure_step, read_unit
from sagittal.core.frames import GRAVITY, Floats

PIECE: Final = 1 << 21
"""Bytes of the beginning that are read: minutes of a few sensors."""
SHOWN: Final = 6
"""Rows of a preview."""
THE_FILE: Final = "*"
"""Name of a sensor whose columns name none: it is called as its file."""
_CELL: Final = 40
"""Characters of a cell that a preview shows."""

_AXES: Final = {
    "acc": ("xyz", "123", "012"),
    "gyr": ("xyz", "123", "012"),
    "mag": ("xyz", "123", "012"),
    "linear": ("xyz",),
    "gravity": ("xyz",),
    "quat": ("wxyz", "0123"),
}
_COUNTER: Final = re.compile(
    r"(?:packet[\s_]*)?(?:counter|count)|samples?(?:[\s_]*(?:index|number|no))?|frames?|index", re.IGNORECASE
)
_RATE: Final = re.compile(
    r"(?:freq\w*|rate|fs)\W{0,6}(\d{1,5}(?:\.\d+)?)|(\d{1,5}(?:\.\d+)?)\s*Hz", re.IGNORECASE
)
_RATES: Final = (20.0, 2000.0)
"""Rates an inertial sensor has: the unit of a clock is the one that gives such a rate."""
_UNIT_OF: Final = {scale: unit for unit, scale in reversed(TIME_UNITS.items())}
_NEAR: Final = 0.35
"""How far the median acceleration may be from gravity, as a share of it: walking does not move it further."""
_WITHOUT_GRAVITY: Final = 3.0
"""m/s²: a quarter of the samples of an acceleration without gravity is smaller."""
_MOVING: Final = 0.7
"""m/s²: spread of the length of acceleration above which a body moves."""
_FASTEST: Final = {True: (28.0, 35.0), False: (1.0, 2.0)}
"""Of a body that moves, that is still: its fastest percent of turns is below the first number in rad/s, above
the second in deg/s."""


@dataclass(frozen=True)
class TableLook:
    """The head of a table and its probable content.

    Parameters
    ----------
    names : columns as named in a manifest. rows : the first ones, as text. source : entry of `sources`
        without `file`; undetermined items are omitted. A sensor not named by any column is called THE_FILE.
    """

    names: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    source: Mapping[str, Any]


def look_into_table(file: SourceFile) -> TableLook | None:
    """Guess the content of a table; None if it is not a table, or has no identifiable acceleration.

    For a table without three columns of one acceleration `columns` is empty.
    """
    data = _read_head(file)
    if data is None or sniff(data)[0] != "table":
        return None
    shape = find_layout(text.head_lines(data, LINES))
    if shape is None:
        return None
    separator, skip, header, rows_from = shape.separator, shape.skip_rows, shape.header_rows, shape.first_row
    index_column = shape.index_column
    lines = text.head_lines(data, rows_from + SHOWN + 1)
    squeeze = text.squeeze_blanks if separator == b" " else bytes
    spec = SourceSpec(file=file.name, skip_rows=skip, header_rows=header, index_column=index_column)
    first = squeeze(lines[rows_from])
    titles = find_titles([squeeze(x) for x in lines[skip:rows_from]], first, separator, spec)
    names = text.number_columns(titles)
    preview = [
        text.split(squeeze(line), separator) for line in lines[rows_from : rows_from + SHOWN] if line.strip()
    ]
    values = _values(data, rows_from, separator, names, shape.decimal_comma)
    source: dict[str, Any] = {"skip_rows": skip, "header_rows": header, "separator": separator.decode()}
    if index_column:
        source["index_column"] = True
    # several columns of time: only a person knows which one belongs to the sensors
    unique = [name for name in names if name in titles]
    kind, _ = read_file_kind(file.name)
    source |= _clock(unique, values, b"\n".join(lines[:skip]).decode("utf-8", "replace"))
    source |= _signals(names, _fill_titles(lines[skip:rows_from], separator, titles), values.values, kind)
    if not header and not source["columns"]:
        source |= _by_values(names, values, source.get("time_column"))
    return TableLook(tuple(names), tuple(tuple(c[:_CELL] for c in row) for row in preview), source)


def make_entry(source: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The entry of `sources` for one file with that layout; raises ManifestError without columns."""
    column_groups = source.get("columns")
    if not isinstance(column_groups, Mapping) or not column_groups:
        raise ManifestError(
            "manifest_bad_value", f"No column of {name} is said to be acceleration; name its x, y and z."
        )
    columns = {
        (segment_in(name) or stem_of(name)) if sensor == THE_FILE else sensor: group
        for sensor, group in column_groups.items()
    }
    return {**source, "file": name, "columns": columns}


def guess_entry(file: SourceFile) -> dict[str, Any] | None:
    """Entry of `sources` for a self-describing table; None if any required item is missing."""
    look = look_into_table(file)
    if look is None:
        return None
    source = dict(look.source)
    groups = list(source["columns"].values())
    kind, device = read_file_kind(file.name)
    whole = all("acc" in g and "gyr" in g for g in groups)
    part = kind is not None and list(source["columns"]) == [THE_FILE]
    acc_known = "acc_unit" in source or not any({"acc", "linear", "gravity"} & set(g) for g in groups)
    gyr_known = "gyr_unit" in source or not any("gyr" in g for g in groups)
    timed = "time_column" in source or "rate_hz" in source
    if not groups or not (whole or part) or not (acc_known and gyr_known and timed):
        return None
    if part and not whole:
        source["columns"] = {segment_in(device) or device: groups[0]}
    return make_entry(source, file.name)


def describe_entry(entry: Mapping[str, Any]) -> str:
    """What an entry takes a table for, as a sentence."""
    time = f"time from '{entry['time_column']}'" if "time_column" in entry else f"{entry['rate_hz']:g} Hz"
    units = ", ".join(entry[key] for key in ("acc_unit", "gyr_unit") if key in entry)
    return f"{time}, units {units}, sensors {', '.join(entry['columns'])}"


def read_sample(file: SourceFile, spec: SourceSpec) -> list[Draft]:
    """The sensors of the beginning of a table; raises as `table.read_table`."""
    data = _read_head(file) or b""
    end = data.rfind(b"\n") + 1
    return table.read_table(data[:end] if end and file.size > PIECE else data, file.name, spec)


def _read_head(file: SourceFile) -> bytes | None:
    """Beginning of a table as text, also of a workbook with one sheet; None of other packed files."""
    with file.open() as opened:
        raw = opened.read(PIECE)
    if is_gzip(raw):
        return None
    if is_zip(raw):
        try:
            (sheet,) = expand([file])
        except (InputError, ValueError):
            return None
        raw = sheet.read()[:PIECE] if sheet.name == file.name else b""
    return text.to_utf8(raw)


def _values(data: bytes, rows_from: int, separator: bytes, names: Sequence[str], comma: bool) -> text.Columns:
    """Columns of the complete lines of a beginning, NaN for non-numeric cells."""
    body = text.after_lines(data, rows_from)
    end = bytes(body).rfind(b"\n") + 1
    rows = bytes(body[:end] if end else body)
    if separator == b" ":
        rows = text.squeeze_blanks(rows)
    try:
        return text.read_columns(
            memoryview(rows), "", separator, names, names, decimal_comma=comma, times=names
        )
    except FormatError:
        return text.Columns({}, ())


def _clock(names: Sequence[str], table: text.Columns, preamble: str) -> dict[str, Any]:
    """Time source: a clock, else a counter, else a rate alone; and the rate if it can be determined."""
    values = table.values
    rate = next((float(a or b) for a, b in _RATE.findall(preamble) if 1.0 <= float(a or b) <= 10_000.0), None)
    constant: dict[str, Any] = {}
    for name in names:
        if name in table.times:
            return {"time_column": name}
        column = values.get(name, np.zeros(0))
        if not is_time_name(name) or len(column) < 3:
            continue
        if measure_step(column) is None:
            constant = constant or {"time_column": name, "time_unit": read_unit(name) or "s"}
            continue
        with suppress(ManifestError):
            tick = find_tick(name, column, rate, "")
            return {"time_column": name, "time_unit": _UNIT_OF.get(tick, tick)}
    clock: dict[str, Any] = {} if rate is None else {"rate_hz": rate}
    for name in names:
        steps = np.diff(values.get(name, np.zeros(0)))
        if _COUNTER.fullmatch(name.rsplit("/", 1)[-1]) and len(steps) > 2 and np.median(steps) == 1.0:
            return {**clock, "counter": {"column": name}}
    return clock or constant


def _fill_titles(header: Sequence[bytes], separator: bytes, titles: Sequence[str]) -> list[str]:
    """Titles under merged cells: a blank cell of a header line but the last repeats the one to its left."""
    if len(header) < 2:
        return list(titles)
    rows = [text.split(line, separator) for line in header]
    filled = []
    for row in rows[:-1]:
        last, out = "", []
        for cell in [*row, *[""] * (len(titles) - len(row))]:
            last = cell or last
            out.append(last)
        filled.append(out)
    last_row = [*rows[-1], *[""] * (len(titles) - len(rows[-1]))]
    return [
        "/".join(p for p in (*(row[i] for row in filled), last_row[i]) if p) if last_row[i] else titles[i]
        for i in range(len(titles))
    ]


def _by_values(names: Sequence[str], table: text.Columns, clock: str | None) -> dict[str, Any]:
    """Columns of a table without a header: three of the length of gravity, then the rate of turn."""
    numbers = [n for n in names if n != clock and n not in table.times and n in table.values]
    for i in range(len(numbers) - 5):
        columns = {THE_FILE: {"acc": numbers[i : i + 3], "gyr": numbers[i + 3 : i + 6]}}
        acc = _acc_unit(columns, table.values)
        if acc is not None and (gyr := _gyr_unit(columns, table.values, acc)) is not None:
            return {"columns": columns, "acc_unit": acc, "gyr_unit": gyr}
    return {}


def _signals(
    names: Sequence[str], titles: Sequence[str], values: Mapping[str, Floats], file_kind: str | None
) -> dict[str, Any]:
    """Columns of every sensor with an acceleration, and their units; repeated titles belong to several
    sensors.
    """
    groups: dict[str, dict[str, dict[str, str]]] = {}
    units: dict[str, set[str]] = {"acc": set(), "gyr": set()}
    title_count: Counter[str] = Counter()
    for name, title in sorted(zip(names, titles, strict=True), key=lambda pair: not names_quantity(pair[1])):
        parts = read_name(title, file_kind)
        if parts is None:
            continue
        sensor, kind, axis, unit = parts
        if titles.count(title) > 1:
            title_count[title] += 1
            sensor = f"{sensor or 'sensor'} {title_count[title]}"
        groups.setdefault(sensor, {}).setdefault(kind, {}).setdefault(axis, name)
        like = "acc" if kind in ("linear", "gravity") else kind
        if unit and like in units:
            units[like].add(unit)
    columns: dict[str, dict[str, list[str]]] = {}
    for sensor, kinds in groups.items():
        whole = {
            kind: [axes[a] for a in order]
            for kind, axes in kinds.items()
            if kind in _AXES and (order := next((o for o in _AXES[kind] if set(o) <= set(axes)), None))
        }
        if "acc" in whole or (file_kind is not None and whole):
            columns[sensor or THE_FILE] = whole
    phone = "seconds_elapsed" in names  # Sensor Logger: m/s² and rad/s, "Accelerometer" is without gravity
    for group in columns.values():
        if file_kind == "acc" and "acc" in group and _lacks_gravity(group, values, units["acc"]):
            group["linear"] = group.pop("acc")
    source: dict[str, Any] = {"columns": columns}
    acc = _only(units["acc"], ACC_UNITS) or _acc_unit(columns, values)
    if acc is None and (phone or any({"linear", "gravity"} & set(c) for c in columns.values())):
        acc = "m/s2"
    if acc is not None:
        source["acc_unit"] = acc
    if any("gyr" in c for c in columns.values()) and (
        gyr := _only(units["gyr"], GYR_UNITS) or ("rad/s" if phone else _gyr_unit(columns, values, acc))
    ):
        source["gyr_unit"] = gyr
    if any("quat" in c for c in columns.values()):
        source["quat_order"] = "wxyz"
    return source


def _lacks_gravity(group: Mapping[str, Sequence[str]], values: Mapping[str, Floats], units: set[str]) -> bool:
    """Whether an acceleration, in m/s² if its unit is unnamed, is most often far below gravity."""
    if units - {"m/s2"}:
        return False
    norms = _norms({THE_FILE: group}, "acc", values)
    return (
        bool(len(norms))
        and float(np.quantile(norms, 0.25)) < _WITHOUT_GRAVITY
        and not (not units and abs(float(np.median(norms)) - 1.0) < _NEAR)
    )


def _only(units: set[str], factors: Mapping[str, float]) -> str | None:
    return next(iter(units)) if len(units) == 1 and next(iter(units)) in factors else None


def _norms(
    columns: Mapping[str, Mapping[str, Sequence[str]]], kind: str, values: Mapping[str, Floats]
) -> Floats:
    """Norms of one quantity over all sensors."""
    norms = [
        np.linalg.norm(np.stack([values[c] for c in group[kind]], axis=1), axis=1)
        for group in columns.values()
        if kind in group and all(c in values for c in group[kind])
    ]
    joined = np.concatenate(norms) if norms else np.zeros(0)
    return joined[np.isfinite(joined)]


def _acc_unit(columns: Mapping[str, Mapping[str, Sequence[str]]], values: Mapping[str, Floats]) -> str | None:
    """The unit in which the median of the acceleration is gravity."""
    norms = _norms(columns, "acc", values)
    median = float(np.median(norms)) if len(norms) else 0.0
    return next((u for u in ("m/s2", "g", "mg") if abs(median * ACC_UNITS[u] / GRAVITY - 1.0) < _NEAR), None)


def _gyr_unit(
    columns: Mapping[str, Mapping[str, Sequence[str]]], values: Mapping[str, Floats], acc_unit: str | None
) -> str | None:
    """The unit in which angular rates are plausible for a human body; None if both are."""
    norms, acc = _norms(columns, "gyr", values), _norms(columns, "acc", values)
    if not len(norms) or not len(acc) or acc_unit is None:
        return None
    top = float(np.quantile(norms, 0.99))
    low, high = _FASTEST[float(np.std(acc)) * ACC_UNITS[acc_unit] > _MOVING]
    return "rad/s" if 0.0 < top < low else "deg/s" if top > high else None
