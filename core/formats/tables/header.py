"""Names of the columns of a table, and those that an entry of `sources` asks for."""

from __future__ import annotations

import difflib
from dataclasses import replace

from sagittal.core.errors import ManifestError
from sagittal.core.formats import text
from sagittal.core.formats.source_spec import Channels, SourceSpec
from sagittal.core.formats.tables.layout import LINES, TableLayout


def join_titles(header: list[bytes], rows: list[bytes], separator: bytes, spec: SourceSpec) -> list[str]:
    """Titles of the columns of a table from its header lines and the usual width of its rows."""
    squeeze = text.squeeze_blanks if separator == b" " else bytes
    widest = max(rows[:LINES], key=lambda row: row.count(separator))
    usual = rows[0] if rows[0].count(separator) == rows[-1].count(separator) else widest
    return find_titles([squeeze(line) for line in header], squeeze(usual), separator, spec)


def find_header(
    lines: list[bytes], spec: SourceSpec, layout: TableLayout | None, declared_separator: bytes | None
) -> tuple[int, int]:
    """Lines before the header and of it: as declared, else where the declared columns are named."""
    if spec.skip_rows is not None:
        return spec.skip_rows, 1 if spec.header_rows is None else spec.header_rows
    if layout is None:
        return 0, 1 if spec.header_rows is None else spec.header_rows
    if spec.header_rows is not None:
        return max(0, layout.first_row - spec.header_rows), spec.header_rows
    required_columns = {
        name.split("#")[0] for _, channels in spec.columns.items() for _, name in list_asked(channels)
    }
    required_columns |= {name for name in (spec.time_column, name_counter(spec)) if name is not None}
    separator = declared_separator or layout.separator
    candidates = [(layout.skip_rows, layout.header_rows), *((i, 1) for i in range(layout.first_row))]
    for skip, header in candidates:
        titles = join_titles(lines[skip : skip + header], lines[layout.first_row :], separator, spec)
        if required_columns <= {*titles, *text.number_columns(titles)}:
            return skip, header
    return candidates[0]


def find_titles(header: list[bytes], row: bytes, separator: bytes, spec: SourceSpec) -> list[str]:
    """Column titles; several header rows are joined by "/", a table without a header is numbered 1, 2, 3 …"""
    cells = row.count(separator) + 1
    parts = [text.split(line, separator) for line in header]
    parts = [[*p, *[""] * (cells - len(p))][:cells] if len(p) >= cells else p for p in parts]
    if not parts:
        return [str(i + 1) for i in range(cells)]
    width = max(len(p) for p in parts)
    names = ["/".join(p[i] for p in parts if i < len(p) and p[i]) for i in range(width)]
    if spec.index_column and width == cells - 1:
        names = ["", *names]
    return [*names, *[""] * (cells - len(names))]


def list_wanted(spec: SourceSpec, titles: list[str], source: str) -> list[str]:
    """Columns that an entry asks for; raises ManifestError `unknown_column`, `ambiguous_column`."""
    names = text.number_columns(titles)
    data_columns = names[1:] if spec.index_column else names
    column_names: list[str] = []
    requests = [(f"columns.{d}.{kind}", n) for d, c in spec.columns.items() for kind, n in list_asked(c)]
    for path, clock in (("time_column", spec.time_column), ("counter.column", name_counter(spec))):
        if clock is not None:
            requests.append((path, clock))
            data_columns = names
    for path, name in requests:
        if name not in names and name in titles:
            raise ManifestError(
                "ambiguous_column",
                f"{path}: expected the name of one column, but {titles.count(name)} columns of {source} are "
                f"called '{name}'. Give one of these names: {text.describe_columns(titles, name)}.",
            )
        if name not in data_columns:
            near = difflib.get_close_matches(name, data_columns, 1, 0.4)
            hint = f"did you mean '{near[0]}'?" if near else f"columns found: {', '.join(data_columns[:20])}."
            raise ManifestError("unknown_column", f"{path}: {source} has no column '{name}'; {hint}")
        if name not in column_names:
            column_names.append(name)
    return column_names


def complete_names(spec: SourceSpec, titles: list[str]) -> SourceSpec:
    """The entry with unique names where a repeated title can only mean the column next to a named one.

    As under a header of merged cells: "Accelerometer/X", "Y", "Z" are three columns side by side.
    """
    names = text.number_columns(titles)

    def complete(group: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if group is None or group[0] not in names:
            return group
        start = names.index(group[0])
        title_group = tuple(titles[start : start + len(group)])
        alike = all(a in (b, n) for a, b, n in zip(group, title_group, names[start:], strict=False))
        return tuple(names[start : start + len(group)]) if len(title_group) == len(group) and alike else group

    columns = {
        d: Channels(*map(complete, (c.acc, c.gyr, c.mag, c.quat, c.linear, c.gravity)))
        for d, c in spec.columns.items()
    }
    return replace(spec, columns=columns)


def list_asked(c: Channels) -> list[tuple[str, str]]:
    """Kind of signal and name of every column of a sensor."""
    groups = (
        ("acc", c.acc), ("gyr", c.gyr), ("mag", c.mag), ("quat", c.quat), ("linear", c.linear),
        ("gravity", c.gravity),
    )  # fmt: skip
    return [(kind, name) for kind, group in groups for name in group or ()]


def name_counter(spec: SourceSpec) -> str | None:
    """Column that counts samples, None without one."""
    return None if spec.counter is None else spec.counter.column
