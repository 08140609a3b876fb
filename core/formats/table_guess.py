"""Probable content of an unknown table: layout, clock, signals, units, as an entry of `sources` to confirm.

Only its beginning is read, whatever its length.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
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
from sagittal.core.formats.tables.header import find_titles
from sagittal.core.formats.tables.layout import LINES, find_layout
from sagittal.core.frames import GRAVITY, Floats

PIECE: Final = 1 << 21
"""Bytes of the beginning that are read: minutes of a few sensors."""
SHOWN: Final = 6
"""Rows of a preview."""
THE_FILE: Final = "*"
"""Name of a sensor whose columns name none: it is called as its file."""
_CELL: Final = 40
"""Characters of a cell that a preview shows."""

_AXIS: Final = re.compile(r"^(?P<rest>.*?)[\s_./\-:]*(?P<axis>[xyzwXYZW]|[0-3])$")
_CHANNEL: Final = re.compile(r"(?<=[.:_][xyzwXYZW]) \d{1,2}$")
"""Number of a channel behind its axis ("ACC.X 1")."""
_UNIT: Final = re.compile(r"[\[(](?P<unit>[^\])]{1,12})[\])]\s*$")
_KINDS: Final = (
    ("free", re.compile(r"free[\s_]*acc|lin(?:ear)?[\s_]*acc|user[\s_]*acc", re.IGNORECASE)),
    ("acc", re.compile(r"acc(?:el(?:erometer|eration)?)?(?![a-z])", re.IGNORECASE)),
    (
        "gyr",
        re.compile(
            r"gyr(?:o(?:scope)?)?(?![a-z])|angular[\s_]*(?:velocity|rate)|rate[\s_]*of[\s_]*turn",
            re.IGNORECASE,
        ),
    ),
    ("mag", re.compile(r"mag(?:n(?:et(?:ometer|ic[\s_]*field)?)?)?(?![a-z])", re.IGNORECASE)),
    ("quat", re.compile(r"quat(?:ernion)?(?![a-z])|(?:^|[\s_./\-])q$", re.IGNORECASE)),
)
_AXES: Final = {
    "acc": ("xyz", "123", "012"),
    "gyr": ("xyz", "123", "012"),
    "mag": ("xyz", "123", "012"),
    "quat": ("wxyz", "0123"),
}
_TIME: Final = re.compile(
    r"(?:time(?:[\s_]*stamp)?|t|seconds)(?:[\s_\[(]+(s|ms|us|µs|ns)[\])]?)?", re.IGNORECASE
)
_COUNTER: Final = re.compile(
    r"(?:packet[\s_]*)?(?:counter|count)|samples?(?:[\s_]*(?:index|number|no))?|frames?|index", re.IGNORECASE
)
_RATE: Final = re.compile(
    r"(?:freq\w*|rate|fs)\W{0,6}(\d{1,5}(?:\.\d+)?)|(\d{1,5}(?:\.\d+)?)\s*Hz", re.IGNORECASE
)
_RATES: Final = (20.0, 2000.0)
"""Rates an inertial sensor has: the unit of a clock is the one that gives such a rate."""
_SAID: Final = {
    "m/s/s": "m/s2",
    "m/s^2": "m/s2",
    "m/s2": "m/s2",
    "m/s²": "m/s2",
    "g": "g",
    "mg": "mg",
    "deg/s": "deg/s",
    "dps": "deg/s",
    "°/s": "deg/s",
    "rad/s": "rad/s",
}
_NEAR: Final = 0.35
"""How far the median acceleration may be from gravity, as a share of it: walking does not move it further."""
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
    shown = [
        text.split(squeeze(line), separator) for line in lines[rows_from : rows_from + SHOWN] if line.strip()
    ]
    values = _values(data, rows_from, separator, names, shape.decimal_comma)
    source: dict[str, Any] = {"skip_rows": skip, "header_rows": header, "separator": separator.decode()}
    if index_column:
        source["index_column"] = True
    # several columns of time: only a person knows which one belongs to the sensors
    unique = [name for name in names if name in titles]
    source |= _clock(unique, values, b"\n".join(lines[:skip]).decode("utf-8", "replace"))
    source |= _signals(names, titles, values)
    return TableLook(tuple(names), tuple(tuple(c[:_CELL] for c in row) for row in shown), source)


def make_entry(source: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The entry of `sources` for one file with that layout; raises ManifestError without columns."""
    said = source.get("columns")
    if not isinstance(said, Mapping) or not said:
        raise ManifestError(
            "manifest_bad_value", f"No column of {name} is said to be acceleration; name its x, y and z."
        )
    columns = {
        (segment_in(name) or stem_of(name)) if sensor == THE_FILE else sensor: group
        for sensor, group in said.items()
    }
    return {**source, "file": name, "columns": columns}


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


def _values(
    data: bytes, rows_from: int, separator: bytes, names: Sequence[str], comma: bool
) -> dict[str, Floats]:
    """Columns of the complete lines of a beginning, NaN for non-numeric cells."""
    body = text.after_lines(data, rows_from)
    end = bytes(body).rfind(b"\n") + 1
    rows = bytes(body[:end] if end else body)
    if separator == b" ":
        rows = text.squeeze_blanks(rows)
    try:
        return text.read_columns(
            memoryview(rows), "", separator, names, names, decimal_comma=comma, times=names
        ).values
    except FormatError:
        return {}


def _clock(names: Sequence[str], values: Mapping[str, Floats], before: str) -> dict[str, Any]:
    """Time source: a clock, else a counter, else a rate alone; and the rate if it can be determined."""
    for name in names:
        said = _TIME.fullmatch(name)
        steps = np.diff(values.get(name, np.zeros(0)))
        steps = steps[np.isfinite(steps)]
        if said is None or len(steps) < 2 or (step := float(np.median(steps))) <= 0:
            continue
        unit = (said[1] or "").lower() or next(
            (u for u, scale in TIME_UNITS.items() if _RATES[0] <= 1 / (step * scale) < _RATES[1]), ""
        )
        if unit:
            return {"time_column": name, "time_unit": unit}
    rate = next((float(a or b) for a, b in _RATE.findall(before) if 1.0 <= float(a or b) <= 10_000.0), None)
    found: dict[str, Any] = {} if rate is None else {"rate_hz": rate}
    for name in names:
        steps = np.diff(values.get(name, np.zeros(0)))
        if _COUNTER.fullmatch(name.rsplit("/", 1)[-1]) and len(steps) > 2 and np.median(steps) == 1.0:
            return {**found, "counter": {"column": name}}
    return found


def _signals(names: Sequence[str], titles: Sequence[str], values: Mapping[str, Floats]) -> dict[str, Any]:
    """Columns of every sensor with an acceleration, and their units; repeated titles belong to several
    sensors.
    """
    groups: dict[str, dict[str, dict[str, str]]] = {}
    units: dict[str, set[str]] = {"acc": set(), "gyr": set()}
    seen: Counter[str] = Counter()
    for name, title in zip(names, titles, strict=True):
        found = _read_name(title)
        if found is None:
            continue
        sensor, kind, axis, unit = found
        if name != title:
            seen[title] += 1
            sensor = f"{sensor or 'sensor'} {seen[title]}"
        groups.setdefault(sensor, {}).setdefault(kind, {}).setdefault(axis, name)
        if unit and kind in units:
            units[kind].add(unit)
    columns: dict[str, dict[str, list[str]]] = {}
    for sensor, kinds in groups.items():
        whole = {
            kind: [axes[a] for a in order]
            for kind, axes in kinds.items()
            if kind in _AXES and (order := next((o for o in _AXES[kind] if set(o) <= set(axes)), None))
        }
        if "acc" in whole:
            columns[sensor or THE_FILE] = whole
    source: dict[str, Any] = {"columns": columns}
    acc = _only(units["acc"], ACC_UNITS) or _acc_unit(columns, values)
    if acc is not None:
        source["acc_unit"] = acc
    if any("gyr" in c for c in columns.values()) and (
        gyr := _only(units["gyr"], GYR_UNITS) or _gyr_unit(columns, values, acc)
    ):
        source["gyr_unit"] = gyr
    if any("quat" in c for c in columns.values()):
        source["quat_order"] = "wxyz"
    return source


def _read_name(name: str) -> tuple[str, str, str, str] | None:
    """Sensor, quantity, axis and unit given in the name of a column."""
    unit = ""
    plain = name.strip()
    if said := _UNIT.search(plain):
        unit, plain = _SAID.get(said["unit"].strip(), ""), plain[: said.start()].strip()
    plain = _CHANNEL.sub("", plain)
    if (axis := _AXIS.match(plain)) is None:
        return None
    rest = axis["rest"]
    for kind, pattern in _KINDS:
        if said := pattern.search(rest):
            if kind == "free":
                return None
            sensor = re.sub(r"[\s_./\-:]+$|^[\s_./\-:]+", "", rest[: said.start()] + " " + rest[said.end() :])
            return re.sub(r"\s+", " ", sensor).strip(), kind, axis["axis"].lower(), unit
    return None


def _only(found: set[str], known: Mapping[str, float]) -> str | None:
    return next(iter(found)) if len(found) == 1 and next(iter(found)) in known else None


def _norms(
    columns: Mapping[str, Mapping[str, Sequence[str]]], kind: str, values: Mapping[str, Floats]
) -> Floats:
    """Norms of one quantity over all sensors."""
    found = [
        np.linalg.norm(np.stack([values[c] for c in group[kind]], axis=1), axis=1)
        for group in columns.values()
        if kind in group and all(c in values for c in group[kind])
    ]
    joined = np.concatenate(found) if found else np.zeros(0)
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
