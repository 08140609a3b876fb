"""CSV and TSV tables of any laboratory, described by a manifest: header rows, units, columns per sensor."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from sagittal.core.errors import FormatError, ManifestError, Notice
from sagittal.core.formats import text
from sagittal.core.formats.draft import Draft, make_draft
from sagittal.core.formats.source import SourceFile
from sagittal.core.formats.source_spec import ACC_UNITS, GYR_UNITS, TIME_UNITS, Channels, Counter, SourceSpec
from sagittal.core.frames import Floats
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock

_ROWS_TO_LOOK_AT = 4
_CHUNK: Final = 1 << 23
"""Bytes of a long table that are read at a time."""


def read_table(data: bytes, source: str, spec: SourceSpec) -> list[Draft]:
    """Read all sensors of one table.

    Parameters
    ----------
    data : UTF-8 text. spec : the manifest's entry with `columns`.

    Raises
    ------
    ManifestError
        unit_missing, rate_missing, unknown_column, ambiguous_column.
    FormatError
        empty, bad_table.
    """
    layout = _lay_out(data, source, spec)
    body = text.after_lines(data, spec.skip_rows + spec.header_rows)
    if layout.separator == b" ":
        body = memoryview(squeeze_blanks(bytes(body)))
    table = _without_blank_end(layout.read(body, source), spec)
    ticks, clock = _time(table, spec, source)
    return [
        _sensor(device, channels, table, spec, source, ticks, clock)
        for device, channels in spec.columns.items()
    ]


def _without_blank_end(table: text.Columns, spec: SourceSpec) -> text.Columns:
    """Drop trailing rows without any sensor value, as in exports with a longer EMG recording."""
    names = [name for channels in spec.columns.values() for _, name in _asked(channels)]
    known = np.flatnonzero(np.isfinite(table.stack(names)).any(axis=1))
    end = known[-1] + 1 if len(known) else None
    return text.Columns({name: values[:end] for name, values in table.values.items()}, table.notices)


@dataclass(frozen=True)
class _Layout:
    """Layout of one table. titles : of all columns. wanted : columns to read."""

    separator: bytes
    titles: list[str]
    wanted: list[str]
    comma: bool

    def read(self, body: memoryview, source: str) -> text.Columns:
        """Parse rows without header into columns."""
        return text.read_columns(
            body, source, self.separator, self.titles, self.wanted, decimal_comma=self.comma
        )


def _lay_out(data: bytes, source: str, spec: SourceSpec) -> _Layout:
    """Layout from the head of a table; errors as in `read_table`."""
    _check(spec, source)
    lines = text.head_lines(data, spec.skip_rows + spec.header_rows + _ROWS_TO_LOOK_AT)
    header = lines[spec.skip_rows : spec.skip_rows + spec.header_rows]
    rows = [r for r in lines[spec.skip_rows + spec.header_rows :] if r.strip()]
    if not rows:
        raise FormatError("empty", f"{source} has a header but no samples; record or export it again.")
    chosen = (
        spec.separator.encode() if spec.separator else text.guess_separator(rows[: max(1, len(rows) - 1)])
    )
    separator = chosen or b","
    if separator == b" ":
        header, rows = [squeeze_blanks(h) for h in header], [squeeze_blanks(r) for r in rows]
    titles = find_titles(header, rows[0], separator, spec)
    return _Layout(
        separator, titles, _wanted(spec, titles, source), text.has_decimal_comma(rows[0], separator)
    )


def estimate_rows(head: bytes, size: int) -> float:
    """Estimated number of lines of a text of this size, from its beginning; 0 for other content."""
    return size * head.count(b"\n") / max(1, len(head)) if text.is_text(head) else 0.0


def open_long_table(file: SourceFile, spec: SourceSpec) -> dict[str, LongStream]:
    """The sensors of a table too long for memory: rows are read in chunks of a few megabytes.

    Raises
    ------
    ManifestError, FormatError as `read_table`; and `counter_too_long`: a long table requires a time column or
    a rate.
    """
    source = file.name
    if spec.counter is not None:
        raise ManifestError(
            "counter_too_long",
            f"{source} is too long to be timed by a counter; give time_column or rate_hz in the manifest.",
        )
    head, tail = _ends(file)
    layout = _lay_out(head, source, spec)
    scale = TIME_UNITS[spec.time_unit]
    body = text.after_lines(head, spec.skip_rows + spec.header_rows)
    first = layout.read(_whole_lines(body), source)
    last = layout.read(_whole_lines(tail), source)
    if spec.time_column is None:
        rate = spec.rate_hz or 0.0
        row = len(bytes(body)) / max(1, len(next(iter(first.values.values()))))
        start, duration = 0.0, file.size / row / rate
    else:
        times, ends = first.values[spec.time_column] * scale, last.values[spec.time_column] * scale
        rate = spec.rate_hz or 1.0 / float(np.median(np.diff(times[np.isfinite(times)])))
        start, duration = float(times[0]), float(np.nanmax(ends) - times[0])
    return {
        device: LongStream(
            device_id=device,
            source=source,
            rate_hz=rate,
            has_gyro=channels.gyr is not None,
            duration_s=duration,
            open_blocks=partial(_read_blocks, file, spec, layout, channels, start, rate),
        )
        for device, channels in spec.columns.items()
    }


def _ends(file: SourceFile) -> tuple[bytes, memoryview]:
    """Beginning of a table, and complete lines of its end."""
    with file.open() as opened:
        head = opened.read(_CHUNK)
        opened.seek(max(0, file.size - _CHUNK // 8))
        tail = opened.read()
    return head, memoryview(tail[tail.find(b"\n") + 1 :])


def _whole_lines(data: memoryview) -> memoryview:
    """Data up to the last line end; all of it without one."""
    end = bytes(data).rfind(b"\n") + 1
    return data[:end] if end else data


def _read_blocks(
    file: SourceFile, spec: SourceSpec, layout: _Layout, channels: Channels, start: float, rate: float
) -> Iterator[SampleBlock]:
    """Iterate over the rows from the first one, in chunks of a few megabytes."""
    acc_unit, gyr_unit = ACC_UNITS[spec.acc_unit or "m/s2"], GYR_UNITS[spec.gyr_unit or "rad/s"]
    rows = 0
    with file.open() as opened:
        for _ in range(spec.skip_rows + spec.header_rows):
            opened.readline()
        rest = b""
        while True:
            data = opened.read(_CHUNK)
            body = rest + data
            end = len(body) if not data else body.rfind(b"\n") + 1
            body, rest = body[:end], body[end:]
            if body.strip():
                part = memoryview(squeeze_blanks(body) if layout.separator == b" " else body)
                table = layout.read(part, file.name)
                acc = table.stack(channels.acc) * acc_unit
                gyr = None if channels.gyr is None else table.stack(channels.gyr) * gyr_unit
                if spec.time_column is None:
                    t_s = (rows + np.arange(len(acc))) / rate
                else:
                    t_s = table.values[spec.time_column] * TIME_UNITS[spec.time_unit] - start
                rows += len(acc)
                timed = np.isfinite(t_s)
                yield SampleBlock(t_s[timed], acc[timed], None if gyr is None else gyr[timed])
            if not data:
                return


def squeeze_blanks(data: bytes) -> bytes:
    """Collapse runs of spaces that align columns, and remove leading ones."""
    return re.sub(rb"(?m)^ +| +(?=\r?$)", b"", re.sub(rb" +", b" ", data))


def _check(spec: SourceSpec, source: str) -> None:
    where = f"sources entry for '{spec.file}'"
    if not spec.columns:
        raise ManifestError(
            "unknown_column", f"{where} names no columns; say which columns of {source} are which sensor."
        )
    if spec.acc_unit is None:
        raise ManifestError(
            "unit_missing", f"{where}: acc_unit is missing; expected one of {', '.join(ACC_UNITS)}."
        )
    if spec.gyr_unit is None and any(c.gyr for c in spec.columns.values()):
        raise ManifestError(
            "unit_missing", f"{where}: gyr_unit is missing; expected one of {', '.join(GYR_UNITS)}."
        )
    if spec.rate_hz is None and spec.counter is not None:
        raise ManifestError("rate_missing", f"{where}: counter.rate_hz is missing; give counts per second.")
    if spec.rate_hz is None and spec.time_column is None:
        raise ManifestError(
            "rate_missing", f"{where}: give rate_hz (samples per second), time_column or counter."
        )
    if spec.quat_order is None and any(c.quat for c in spec.columns.values()):
        raise ManifestError("manifest_bad_value", f"{where}: quat columns need quat_order, 'wxyz' or 'xyzw'.")


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


def _wanted(spec: SourceSpec, titles: list[str], source: str) -> list[str]:
    names = text.number_columns(titles)
    there = names[1:] if spec.index_column else names
    wanted: list[str] = []
    asked = [(f"columns.{d}.{kind}", n) for d, c in spec.columns.items() for kind, n in _asked(c)]
    for path, clock in (("time_column", spec.time_column), ("counter.column", _counted(spec))):
        if clock is not None:
            asked.append((path, clock))
            there = names
    for path, name in asked:
        if name not in names and name in titles:
            raise ManifestError(
                "ambiguous_column",
                f"{path}: expected the name of one column, but {titles.count(name)} columns of {source} are "
                f"called '{name}'. Give one of these names: {text.describe_columns(titles, name)}.",
            )
        if name not in there:
            near = difflib.get_close_matches(name, there, 1, 0.4)
            hint = f"did you mean '{near[0]}'?" if near else f"columns found: {', '.join(there[:20])}."
            raise ManifestError("unknown_column", f"{path}: {source} has no column '{name}'; {hint}")
        if name not in wanted:
            wanted.append(name)
    return wanted


def _asked(c: Channels) -> list[tuple[str, str]]:
    groups = (("acc", c.acc), ("gyr", c.gyr), ("mag", c.mag), ("quat", c.quat))
    return [(kind, name) for kind, group in groups for name in group or ()]


def _counted(spec: SourceSpec) -> str | None:
    return None if spec.counter is None else spec.counter.column


def _time(table: text.Columns, spec: SourceSpec, source: str) -> tuple[Floats, str]:
    """Ticks of every row and their kind (see `Draft`)."""
    if spec.counter is not None:
        counts = table.values[spec.counter.column]
        _check_counter(counts, spec.counter, source)
        return counts, "counter"
    if spec.time_column is None:
        n = len(next(iter(table.values.values())))
        return np.arange(n, dtype=np.float64), "index"
    return table.values[spec.time_column] * TIME_UNITS[spec.time_unit], "device"


def _check_counter(counts: Floats, counter: Counter, source: str) -> None:
    """Reject a column that does not count samples, which would distort time."""
    steps = np.diff(counts[np.isfinite(counts)])
    step = float(np.median(steps)) if len(steps) else 1.0
    if step != 1.0:
        raise FormatError(
            "bad_counter",
            f"{source}: column '{counter.column}' goes up by {step:g} from row to row, expected 1; "
            "name the column that counts samples, or use time_column.",
        )
    highest = float(np.nanmax(counts)) if len(steps) else 0.0
    if counter.wrap is not None and highest >= counter.wrap:
        raise FormatError(
            "bad_counter",
            f"{source}: column '{counter.column}' counts to {highest:.0f}, but counter.wrap is "
            f"{counter.wrap}; expected a larger wrap.",
        )


def _sensor(
    device: str,
    channels: Channels,
    table: text.Columns,
    spec: SourceSpec,
    source: str,
    ticks: Floats,
    clock: str,
) -> Draft:
    notices = list(table.notices)
    acc = table.stack(channels.acc) * ACC_UNITS[spec.acc_unit or "m/s2"]
    gyr = None if channels.gyr is None else table.stack(channels.gyr) * GYR_UNITS[spec.gyr_unit or "rad/s"]
    if not spec.gravity_included:
        notices.append(
            Notice(
                "gravity_removed",
                f"{source}: the manifest says that gravity was removed from the acceleration; "
                "it is needed for orientation, export the raw acceleration.",
                device,
                severity="error",
            )
        )
    quat = None if channels.quat is None else table.stack(channels.quat)
    if quat is not None and spec.quat_order == "xyzw":
        quat = quat[:, [3, 0, 1, 2]]
    mag = None if channels.mag is None else table.stack(channels.mag)
    wrap = spec.counter.wrap if spec.counter else None
    return make_draft(
        device, source, clock, ticks, acc=acc, gyr=gyr, mag=mag, quat=quat, rate_hz=spec.rate_hz,
        notices=notices, wrap=wrap,
    )  # fmt: skip
