"""CSV and TSV tables of any laboratory, described by a manifest: header rows, units, columns per sensor."""

from __future__ import annotations

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
from sagittal.core.formats.tables.header import (
    complete_names,
    find_header,
    join_titles,
    list_asked,
    list_wanted,
)
from sagittal.core.formats.tables.layout import (
    LINES,
    find_layout,
    guess_separator,
    has_decimal_comma,
)
from sagittal.core.formats.tables.time_unit import check_tick, find_tick
from sagittal.core.frames import Floats
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock

_ROWS_OF_TICKS: Final = 1000
"""Rows by which a column of whole numbers is recognised."""
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
    layout, spec = _lay_out(data, source, spec)
    body = text.after_lines(data, layout.first_row)
    if layout.separator == b" ":
        body = memoryview(text.squeeze_blanks(bytes(body)))
    table = _without_blank_end(layout.read(body, source), spec)
    ticks, clock, tick = _time(table, spec, source)
    return [
        draft
        for device, channels in spec.columns.items()
        for draft in _sensor(device, channels, table, spec, source, ticks, clock, tick)
    ]


def _without_blank_end(table: text.Columns, spec: SourceSpec) -> text.Columns:
    """Drop trailing rows without any sensor value, as in exports with a longer EMG recording."""
    names = [name for channels in spec.columns.values() for _, name in list_asked(channels)]
    filled_rows = np.flatnonzero(np.isfinite(table.stack(names)).any(axis=1))
    end = filled_rows[-1] + 1 if len(filled_rows) else None
    values = {name: values[:end] for name, values in table.values.items()}
    return text.Columns(values, table.notices, table.times)


@dataclass(frozen=True)
class _Layout:
    """How the rows of one table are cut.

    Parameters
    ----------
    first_row : lines before the rows. titles : of all columns. wanted : columns that are read. times : those
        of them that may be texts.
    """

    separator: bytes
    first_row: int
    titles: list[str]
    wanted: list[str]
    comma: bool
    times: tuple[str, ...]

    def read(self, body: memoryview, source: str) -> text.Columns:
        """Parse rows without header into columns."""
        return text.read_columns(
            body, source, self.separator, self.titles, self.wanted, decimal_comma=self.comma, times=self.times
        )


def _lay_out(data: bytes, source: str, spec: SourceSpec) -> tuple[_Layout, SourceSpec]:
    """Layout read from the head of a table, and the entry with unique names; errors as in `read_table`."""
    _check(spec, source)
    lines = text.head_lines(data, (spec.skip_rows or 0) + (spec.header_rows or 0) + LINES)
    declared_separator = spec.separator.encode() if spec.separator else None
    layout = find_layout(lines, declared_separator)
    skip, header = find_header(lines, spec, layout, declared_separator)
    rows = [r for r in lines[skip + header :] if r.strip()]
    if not rows:
        raise FormatError("empty", f"{source} has a header but no samples; record or export it again.")
    separator = (
        declared_separator
        or (layout.separator if layout else guess_separator(rows[: max(1, len(rows) - 1)]))
        or b","
    )
    titles = join_titles(lines[skip : skip + header], rows, separator, spec)
    spec = complete_names(spec, titles)
    column_names = list_wanted(spec, titles, source)
    times = () if spec.time_column is None else (spec.time_column,)
    comma = has_decimal_comma(rows, separator)
    return _Layout(separator, skip + header, titles, column_names, comma, times), spec


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
    layout, spec = _lay_out(head, source, spec)
    body = text.after_lines(head, layout.first_row)
    first = layout.read(_whole_lines(body), source)
    last = layout.read(_whole_lines(tail), source)
    if spec.time_column is None:
        rate = spec.rate_hz or 0.0
        row = len(bytes(body)) / max(1, len(next(iter(first.values.values()))))
        start, duration, scale = 0.0, file.size / row / rate, 1.0
    else:
        scale = _find_scale(first, spec, source)
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
            open_blocks=partial(_read_blocks, file, spec, layout, channels, start, rate, scale),
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
    file: SourceFile,
    spec: SourceSpec,
    layout: _Layout,
    channels: Channels,
    start: float,
    rate: float,
    scale: float,
) -> Iterator[SampleBlock]:
    """Iterate over the rows from the first one, in chunks of a few megabytes."""
    acc_unit, gyr_unit = ACC_UNITS[spec.acc_unit or "m/s2"], GYR_UNITS[spec.gyr_unit or "rad/s"]
    rows = 0
    with file.open() as opened:
        for _ in range(layout.first_row):
            opened.readline()
        remainder = b""
        while True:
            data = opened.read(_CHUNK)
            body = remainder + data
            end = len(body) if not data else body.rfind(b"\n") + 1
            body, remainder = body[:end], body[end:]
            if body.strip():
                part = memoryview(text.squeeze_blanks(body) if layout.separator == b" " else body)
                table = layout.read(part, file.name)
                acc = table.stack(channels.acc or ()) * acc_unit
                gyr = None if channels.gyr is None else table.stack(channels.gyr) * gyr_unit
                if spec.time_column is None:
                    t_s = (rows + np.arange(len(acc))) / rate
                else:
                    t_s = table.values[spec.time_column] * scale - start
                rows += len(acc)
                timed = np.isfinite(t_s)
                yield SampleBlock(t_s[timed], acc[timed], None if gyr is None else gyr[timed])
            if not data:
                return


def _check(spec: SourceSpec, source: str) -> None:
    entry = f"sources entry for '{spec.file}'"
    if not spec.columns:
        raise ManifestError(
            "unknown_column", f"{entry} names no columns; say which columns of {source} are which sensor."
        )
    if spec.acc_unit is None and any(c.acc or c.linear or c.gravity for c in spec.columns.values()):
        raise ManifestError(
            "unit_missing", f"{entry}: acc_unit is missing; expected one of {', '.join(ACC_UNITS)}."
        )
    if spec.gyr_unit is None and any(c.gyr for c in spec.columns.values()):
        raise ManifestError(
            "unit_missing", f"{entry}: gyr_unit is missing; expected one of {', '.join(GYR_UNITS)}."
        )
    if spec.rate_hz is None and spec.counter is not None:
        raise ManifestError("rate_missing", f"{entry}: counter.rate_hz is missing; give counts per second.")
    if spec.rate_hz is None and spec.time_column is None:
        raise ManifestError(
            "rate_missing", f"{entry}: give rate_hz (samples per second), time_column or counter."
        )
    if spec.quat_order is None and any(c.quat for c in spec.columns.values()):
        raise ManifestError("manifest_bad_value", f"{entry}: quat columns need quat_order, 'wxyz' or 'xyzw'.")


def _time(table: text.Columns, spec: SourceSpec, source: str) -> tuple[Floats, str, float]:
    """Ticks of every row, their kind, and the smallest unit of a clock in s (see `Draft`)."""
    if spec.counter is not None:
        counts = table.values[spec.counter.column]
        _check_counter(counts, spec.counter, source)
        return counts, "counter", 0.0
    if spec.time_column is None:
        n = len(next(iter(table.values.values())))
        return np.arange(n, dtype=np.float64), "index", 0.0
    scale = _find_scale(table, spec, source)
    values = table.values[spec.time_column]
    finite_values = values[np.isfinite(values)][:_ROWS_OF_TICKS]
    whole = (
        bool(len(finite_values))
        and spec.time_column not in table.times
        and bool((finite_values == np.round(finite_values)).all())
    )
    return values * scale, "device", scale if whole else 0.0


def _find_scale(table: text.Columns, spec: SourceSpec, source: str) -> float:
    """Length in s of the unit of the time column."""
    if spec.time_column is None or spec.time_column in table.times:
        return 1.0
    values = table.values[spec.time_column]
    if spec.time_unit is None:
        return find_tick(spec.time_column, values, spec.rate_hz, source)
    if isinstance(spec.time_unit, float):
        return spec.time_unit
    check_tick(spec.time_column, values, spec.time_unit, source)
    return TIME_UNITS[spec.time_unit]


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
    tick: float,
) -> Iterator[Draft]:
    """A sensor, or parts of it where the file holds no acceleration."""
    notices = list(table.notices)
    wrap = spec.counter.wrap if spec.counter else None
    gyr = None if channels.gyr is None else table.stack(channels.gyr) * GYR_UNITS[spec.gyr_unit or "rad/s"]
    if channels.acc is None:
        factor = ACC_UNITS[spec.acc_unit or "m/s2"]
        parts = {
            "gyr": gyr,
            "mag": None if channels.mag is None else table.stack(channels.mag),
            "linear": None if channels.linear is None else table.stack(channels.linear) * factor,
            "gravity": None if channels.gravity is None else table.stack(channels.gravity) * factor,
        }
        for part, values in parts.items():
            if values is not None:
                yield Draft(
                    device, source, clock, ticks, values, None, None, None, spec.rate_hz, tuple(notices),
                    wrap, tick=tick, part=part,
                )  # fmt: skip
        return
    acc = table.stack(channels.acc) * ACC_UNITS[spec.acc_unit or "m/s2"]
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
    yield make_draft(
        device, source, clock, ticks, acc=acc, gyr=gyr, mag=mag, quat=quat, rate_hz=spec.rate_hz,
        notices=notices, wrap=wrap, tick=tick,
    )  # fmt: skip
