"""Orientations over time from another system: OpenSim .sto, or a table with four columns for each segment.

A reference for comparison, never a recording: it contains no sensor measurements (docs/reference/formats.md,
"Reference orientations").
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats import text
from sagittal.core.formats.source_spec import TIME_UNITS
from sagittal.core.formats.tables import layout
from sagittal.core.frames import Floats

_STO_MARK: Final = b"endheader"
_STO_LINES: Final = 50
"""Header lines of an .sto file at most."""
_TIME: Final = re.compile(r"(?:t|time|timestamp|seconds)(?:[\s_\[(]+(s|ms|us|µs|ns)[\])]?)?", re.IGNORECASE)
_PART: Final = re.compile(
    r"(?P<name>.+?)[\s_.\-:]*(?:q|quat|quaternion)?[\s_.\-]*(?P<part>[wxyz0-3])", re.IGNORECASE
)
_ORDERS: Final = ("wxyz", "0123")
"""Endings of the four columns, scalar first."""
_NORM: Final = (0.9, 1.1)
"""Length that a rounded unit quaternion has."""
_LEAST: Final = 0.5
"""Share of a segment's rows that have to be unit quaternions."""

HOW: Final = "Expected a column 'time' in s, and for each segment four columns like pelvis_qw, _qx, _qy, _qz."


@dataclass(frozen=True, eq=False)
class OrientationTable:
    """Orientations as given in a file, in its own axes.

    Parameters
    ----------
    t_s : (n,) s on its own clock, increasing. q : name → (n, 4) unit, scalar first, NaN if missing.
    """

    source: str
    t_s: Floats
    q: Mapping[str, Floats]
    notices: tuple[Notice, ...] = ()


def read_orientation_table(data: bytes, source: str) -> OrientationTable:
    """Read reference orientations.

    Parameters
    ----------
    data : bytes of an .sto file of quaternions, or of a table with one header row; detected from the content.

    Raises
    ------
    FormatError `empty`, `bad_table`, `ambiguous_column`, `no_quaternions`, `no_time`, `not_unit`.
    """
    data = text.to_utf8(data)
    if not data.strip():
        raise FormatError("empty", f"{source} is empty; copy or export it again.")
    if not text.is_text(data):
        raise FormatError("no_quaternions", f"{source} is not a text file. {HOW}")
    head = text.head_lines(data, _STO_LINES)
    is_sto = any(line.strip().lower() == _STO_MARK for line in head)
    names, body, separator = _open_sto(data, head, source) if is_sto else _open_csv(data, head, source)
    times = [name for name in names if _TIME.fullmatch(name)]
    if not times:
        raise FormatError("no_time", f"{source} has no column of time; found {_few(names)}. {HOW}")
    if len(set(times)) > 1:
        raise FormatError(
            "ambiguous_column",
            f"{source}: expected one column of time, found {_few(times)}. Remove all but one.",
        )
    groups = _group(names, source)
    if not groups:
        raise FormatError("no_quaternions", f"{source} has no quaternions; found {_few(names)}. {HOW}")
    selection = [times[0], *(column for columns in groups.values() for column in columns)]
    comma = layout.has_decimal_comma(layout.first_rows(body), separator)
    table = text.read_columns(body, source, separator, names, selection, decimal_comma=comma)
    match = _TIME.fullmatch(times[0])
    unit = TIME_UNITS[((match and match[1]) or "s").lower()]
    t_s = table.values[times[0]] * unit
    order = np.flatnonzero(np.isfinite(t_s))
    if len(order) < 2 or (np.diff(t_s[order]) <= 0.0).any():
        raise FormatError("no_time", f"{source}: the column '{times[0]}' does not increase; export it again.")
    q = {
        name: _unit(np.stack([table.values[c][order] for c in columns], axis=1), name, source)
        for name, columns in groups.items()
    }
    return OrientationTable(source, t_s[order], q, table.notices)


def _open_sto(data: bytes, head: list[bytes], source: str) -> tuple[list[str], memoryview, bytes]:
    """Column names and rows of an .sto file, each cell "w,x,y,z" split."""
    end = next(i for i, line in enumerate(head) if line.strip().lower() == _STO_MARK)
    if not any(line.replace(b" ", b"").lower() == b"datatype=quaternion" for line in head[:end]):
        raise FormatError(
            "no_quaternions",
            f"{source} is an OpenSim file without DataType=Quaternion; export orientations, not angles.",
        )
    if end + 1 >= len(head):
        raise FormatError("empty", f"{source} has a header but no samples; export it again.")
    first, *quaternion_names = text.split(head[end + 1], b"\t")
    names = [first, *(f"{name}_{part}" for name in quaternion_names for part in _ORDERS[0])]
    body = bytes(text.after_lines(data, end + 2)).replace(b",", b"\t")
    return names, memoryview(body), b"\t"


def _open_csv(data: bytes, head: list[bytes], source: str) -> tuple[list[str], memoryview, bytes]:
    """Column names and rows of a table; lines starting with # or // before its header are skipped."""
    first = next((i for i, line in enumerate(head) if line.strip() and not line.startswith((b"#", b"//"))), 0)
    separator = layout.guess_separator([line for line in head[first : first + 3] if line.strip()])
    if separator is None:
        raise FormatError("bad_table", f"{source} is not a table with one header row. {HOW}")
    names = text.split(head[first], separator)
    return names, text.after_lines(data, first + 1), separator


def _group(names: list[str], source: str) -> dict[str, tuple[str, ...]]:
    """Name → its four columns, scalar first; incomplete ones are omitted."""
    parts: dict[str, dict[str, str]] = {}
    for column in names:
        if (match := _PART.fullmatch(column)) is not None:
            name, part = match["name"], match["part"].lower()
            previous = parts.setdefault(name, {}).setdefault(part, column)
            if previous != column:
                raise FormatError(
                    "ambiguous_column",
                    f"{source}: expected one column for {part} of '{name}', found '{previous}' and '{column}'"
                    ". Remove or rename one of them.",
                )
    return {
        name: tuple(columns[part] for part in order)
        for name, columns in parts.items()
        for order in _ORDERS
        if all(part in columns for part in order)
    }


def _unit(q: Floats, name: str, source: str) -> Floats:
    """The quaternions with rows that are not unit quaternions set to NaN."""
    norm = np.linalg.norm(q, axis=1)
    good = (norm > _NORM[0]) & (norm < _NORM[1])
    if np.count_nonzero(good) < _LEAST * len(q):
        raise FormatError(
            "not_unit",
            f"{source}: most rows of {name} are no unit quaternions; expected w, x, y, z of length 1.",
        )
    return np.where(good[:, None], q / np.where(good, norm, 1.0)[:, None], np.nan)


def _few(names: list[str]) -> str:
    return ", ".join(names[:8]) + (" …" if len(names) > 8 else "")
