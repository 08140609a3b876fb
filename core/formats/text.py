"""Fast parsing of numeric text tables: decoding, separators and pyarrow's CSV reader with readable errors."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, cast

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.csv as pc

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats.clocks.text_times import looks_like_time, parse_times
from sagittal.core.formats.draft import grade_loss
from sagittal.core.frames import Floats
from sagittal.core.plurals import plural

compute: Any = pyarrow.compute
"""Its stubs know no overload for many of these calls."""
SEPARATORS: Final = (b"\t", b";", b",", b"|", b" ")
MISSING: Final = ["", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "null", "NULL", "-", "None"]
LARGEST: Final = 1e30
"""Larger numbers are damage; they would not fit float32."""
MOST_LISTED: Final = 20
"""Columns that a message lists."""
_LONGEST_LINE: Final = 1_000_000
_HEAD: Final = 1 << 16
_FIRST_ROWS: Final = 20
_NUMBER: Final = r"^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$"


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns by name; a missing or unreadable cell is NaN. `times` were dates or times of day, now s."""

    values: dict[str, Floats]
    notices: tuple[Notice, ...]
    times: frozenset[str] = frozenset()

    def stack(self, names: Sequence[str]) -> Floats:
        """Columns as an array (n, len(names))."""
        return np.stack([self.values[name] for name in names], axis=-1)


def to_utf8(data: bytes) -> bytes:
    """Strip a byte order mark; convert UTF-16 (Excel's "Unicode text") and Latin-1 to UTF-8; pass binary
    data through.
    """
    if data[:3] == b"\xef\xbb\xbf":
        data = data[3:]
    elif data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace").encode("utf-8", errors="replace")
    if data.isascii() or not is_text(data):
        return data
    try:
        data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1").encode()
    return data


def is_text(data: bytes) -> bool:
    """Whether the head contains no NUL byte."""
    return b"\0" not in data[:_HEAD]


def head_lines(data: bytes, most: int = 64) -> list[bytes]:
    """First lines without line ends; lines longer than 1 MB are truncated."""
    lines: list[bytes] = []
    position = 0
    while len(lines) < most and position < len(data):
        end = data.find(b"\n", position, position + _LONGEST_LINE)
        end = len(data) if end < 0 else end
        lines.append(data[position:end].rstrip(b"\r"))
        position = end + 1
    return lines


def read_separator(first: bytes) -> bytes | None:
    """Separator from a first line "sep=,", None without one; a tab may be written as an escape sequence."""
    separator_match = re.match(rb'"?sep=(\\t|[,;\t|])', first)
    return None if separator_match is None else b"\t" if separator_match[1] == rb"\t" else separator_match[1]


def after_lines(data: bytes, n: int) -> memoryview:
    """The data after the first n lines, without a copy."""
    position = 0
    for _ in range(n):
        position = data.find(b"\n", position) + 1
        if position == 0:
            return memoryview(b"")
    return memoryview(data)[position:]


def split(line: bytes, separator: bytes) -> list[str]:
    """Cells of a line as text, without quotes and surrounding blanks."""
    text = line.decode("utf-8", errors="replace")
    return [c.strip().strip('"').strip() for c in text.split(separator.decode())]


def first_row(body: memoryview) -> bytes:
    """First line of rows without a header, up to 64 kB."""
    return bytes(body[:_HEAD]).split(b"\n", 1)[0].rstrip(b"\r")


def fit_names(names: Sequence[str], body: memoryview, separator: bytes) -> list[str]:
    """Names for the cells of a row if rows and header differ in trailing separators."""
    cells = first_row(body).count(separator) + 1
    named = list(names)
    while len(named) > cells and not named[-1].strip():
        named.pop()
    return [*named, *[""] * (cells - len(named))]


def squeeze_blanks(data: bytes) -> bytes:
    """Columns that were lined up with several spaces are one space apart, and none is before the first."""
    return re.sub(rb"(?m)^ +| +(?=\r?$)", b"", re.sub(rb" +", b" ", data))


def read_columns(
    body: memoryview,
    source: str,
    separator: bytes,
    names: Sequence[str],
    selection: Sequence[str],
    *,
    decimal_comma: bool,
    times: Sequence[str] = (),
) -> Columns:
    """Read selected columns of a table without its header.

    Parameters
    ----------
    body : rows, starting at a line start. names : titles of all columns in order. selection : some of them,
        or names that `number_columns` gives them. times : those of them that may hold dates or times of day
        as text, which are read as seconds.

    Raises
    ------
    FormatError bad_table if most rows do not have the columns of the header, ambiguous_column if several
        columns have a selected title.
    """
    titles, names = names, number_columns(names)
    _check_titles(titles, names, selection, source)
    if not bytes(body[:_HEAD]).strip():
        raise FormatError("empty", f"{source} has a header but no samples; record or export it again.")
    texts = [name for name in times if _holds_times(body, separator, list(names).index(name))]
    table = _Table(_as_utf8(body), separator, names, selection, decimal_comma, texts)
    values, rows, notices = _read_values(table, source)
    notices += _check_rows(rows, table.broken, len(names), source)
    return Columns(values, tuple(notices), frozenset(texts))


def _holds_times(body: memoryview, separator: bytes, column: int) -> bool:
    """Whether the first cells of a column are dates or times of day."""
    rows = [split(line, separator) for line in head_lines(bytes(body[:_HEAD]), _FIRST_ROWS)]
    sample_cells = [row[column] for row in rows if len(row) > column and row[column] not in MISSING]
    return bool(sample_cells) and sum(looks_like_time(cell) for cell in sample_cells) > len(sample_cells) / 2


@dataclass(frozen=True, eq=False)
class _Table:
    """A table without its header.

    Parameters
    ----------
    texts : wanted columns of dates or times. broken : cells of each row of values that was left out, and
        `others`, first cells of lines that hold no values.
    """

    body: memoryview
    separator: bytes
    names: list[str]
    wanted: Sequence[str]
    decimal_comma: bool
    texts: Sequence[str] = ()
    broken: list[int] = field(default_factory=list)
    others: list[str] = field(default_factory=list)

    def read(self, kind: pa.DataType) -> pa.Table:
        """The wanted columns, all of one type but for times; ArrowInvalid where a cell is not of it."""
        self.broken.clear()
        self.others.clear()
        read = pc.ReadOptions(column_names=self.names, use_threads=False, block_size=1 << 22)
        parse = pc.ParseOptions(
            delimiter=self.separator.decode(), invalid_row_handler=self._skip, ignore_empty_lines=True
        )
        convert = pc.ConvertOptions(
            column_types=dict.fromkeys(self.wanted, kind) | dict.fromkeys(self.texts, pa.string()),
            include_columns=list(self.wanted),
            null_values=MISSING,
            strings_can_be_null=True,
            decimal_point="," if self.decimal_comma else ".",
        )
        return pc.read_csv(cast("Any", pa.BufferReader(pa.py_buffer(self.body))), read, parse, convert)

    def _skip(self, row: pc.InvalidRow) -> Literal["skip"]:
        line = row.text or ""
        if re.search(r"(^|[^\w.])[-+]?\d+([.,]\d+)?($|[^\w.])", line) and row.actual_columns > 1:
            self.broken.append(row.actual_columns)
        else:
            self.others.append(line)
        return "skip"


def _check_titles(titles: Sequence[str], names: Sequence[str], selection: Sequence[str], source: str) -> None:
    """Raise `ambiguous_column` if several columns have a selected title."""
    for name in selection:
        if name not in names and name in titles:
            raise FormatError(
                "ambiguous_column",
                f"{source}: expected one column '{name}', found {titles.count(name)}: "
                f"{describe_columns(titles, name)}. Export it again with each column once, "
                "or name the right columns in a manifest.",
            )


def _read_values(table: _Table, source: str) -> tuple[dict[str, Floats], int, list[Notice]]:
    """The wanted columns, the number of rows, and notices of lines and cells that are no numbers."""
    notices: list[Notice] = []
    try:
        data = table.read(pa.float64())
        header_repeats = 0
    except pa.ArrowInvalid:
        try:
            data = table.read(pa.string())
        except pa.ArrowInvalid as e:
            raise FormatError("bad_table", f"{source} is not a readable table ({e}); export it again.") from e
        data, header_repeats, bad = _as_numbers(data, table)
        if bad:
            notices.append(
                Notice(
                    "bad_cells",
                    f"{source}: {bad} cells are not numbers and count as missing; the export may be damaged.",
                    severity=grade_loss(bad, len(data) * len(table.wanted)),
                )
            )
    if header_repeats or table.others:
        lines = header_repeats + len(table.others)
        notices.append(
            Notice(
                "lines_without_values",
                f"{source}: {lines} {plural(lines, 'line', 'lines')} among the rows "
                f"{plural(lines, 'is', 'are')} a header again or a comment and "
                f"{plural(lines, 'was', 'were')} left out.",
                severity="info",
            )
        )
    values = {n: parse_times(data[n]) if n in table.texts else _as_floats(data[n]) for n in table.wanted}
    return values, len(data), notices


def _as_numbers(data: pa.Table, table: _Table) -> tuple[pa.Table, int, int]:
    """Text cells as numbers, without rows of texts alone; how many these are, and other bad cells."""
    columns, bad = [], np.zeros(len(data), np.int64)
    for name in table.wanted:
        cells = data[name]
        if name in table.texts:
            columns.append(cells)
            continue
        cells = compute.utf8_trim_whitespace(cells)
        if table.decimal_comma:
            cells = compute.replace_substring(cells, ",", ".")
        good = compute.match_substring_regex(cells, _NUMBER)
        bad += np.asarray(compute.fill_null(compute.invert(good), False).to_numpy())
        columns.append(compute.if_else(good, cells, None).cast(pa.float64()))
    whole = pa.table(columns, names=list(table.wanted))
    numbers = len(table.wanted) - len(table.texts)
    header = bad >= max(1, numbers)
    left = int(bad.sum() - bad[header].sum())
    return (whole.filter(pa.array(~header)) if header.any() else whole), int(header.sum()), left


def _check_rows(rows: int, broken: Sequence[int], columns: int, source: str) -> list[Notice]:
    """A notice on rows without the columns of the header; `bad_table` if most are."""
    if rows == 0 or len(broken) > max(2, rows // 2):
        raise FormatError(
            "bad_table",
            f"{source}: {len(broken)} of {rows + len(broken)} rows "
            f"{plural(len(broken), 'does', 'do')} not have the {columns} columns of the header "
            f"(found {broken[0] if broken else 0}); export it again with one separator.",
        )
    if not broken:
        return []
    return [
        Notice(
            "truncated_line",
            f"{source}: {len(broken)} of {rows + len(broken)} lines "
            f"{plural(len(broken), 'does', 'do')} not have {columns} columns and "
            f"{plural(len(broken), 'was', 'were')} left out; the file may have been cut off "
            "while it was written.",
            severity=grade_loss(len(broken), rows + len(broken)),
        )
    ]


def _as_utf8(body: memoryview) -> memoryview:
    """The data as valid UTF-8; text with a NUL only after its head may contain anything."""
    if np.frombuffer(body, np.uint8).max(initial=0) < 128:
        return body
    data = bytes(body)
    try:
        data.decode()
    except UnicodeDecodeError:
        return memoryview(data.decode("utf-8", "replace").encode())
    return body


def _as_floats(column: pa.ChunkedArray[Any]) -> Floats:
    """Arrow column to float64 with NaN for null and for values impossible for sensors and clocks."""
    return _plausible(np.array(column.to_numpy(), np.float64))


def _plausible(x: Floats) -> Floats:
    x[~(np.abs(x) < LARGEST)] = np.nan
    return x


def number_columns(titles: Sequence[str]) -> list[str]:
    """One unique name per column.

    A title shared by several columns is numbered: "X [s]#1", "X [s]#2", … A blank title becomes "column 3",
    by its position.
    """
    titles = [title or f"column {i}" for i, title in enumerate(titles, 1)]
    counts, used = Counter(titles), set(titles)
    title_count: Counter[str] = Counter()
    names = []
    for title in titles:
        name = title
        if counts[title] > 1:
            title_count[title] += 1
            name = f"{title}#{title_count[title]}"
            while name in used:  # some other column has this as its own title
                name += "#"
            used.add(name)
        names.append(name)
    return names


def describe_columns(titles: Sequence[str], title: str) -> str:
    """The columns that share a title: unique name, position and neighbours of each."""
    names = number_columns(titles)
    listed = []
    for i in [i for i, t in enumerate(titles) if t == title]:
        previous_title, next_title = names[i - 1] if i else None, names[i + 1] if i + 1 < len(names) else None
        if previous_title and next_title:
            context = f", between '{previous_title}' and '{next_title}'"
        else:
            context = (
                f", before '{next_title}'"
                if next_title
                else f", after '{previous_title}'"
                if previous_title
                else ""
            )
        listed.append(f"'{names[i]}' (column {i + 1}{context})")
    more = f" and {len(listed) - MOST_LISTED} more" if len(listed) > MOST_LISTED else ""
    return ", ".join(listed[:MOST_LISTED]) + more
