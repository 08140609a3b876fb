"""Xsens MT Manager text exports, 4.x to 2022 (docs/reference/formats.md, "Xsens MT Manager text"): one file
per sensor.

Comment lines ("//"), one header line, then rows separated by tab, comma, semicolon or space. Any subset of
the columns may be present; blank or "NaN" cells are missing; the packet counter has 16 bit.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core import rotation
from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats import text
from sagittal.core.formats.draft import Draft
from sagittal.core.formats.source import stem_of
from sagittal.core.formats.source_spec import ACC_UNITS, GYR_UNITS, SourceSpec
from sagittal.core.formats.tables.layout import has_decimal_comma
from sagittal.core.frames import Floats

_ACC: Final = ("Acc_X", "Acc_Y", "Acc_Z")
_GYR: Final = ("Gyr_X", "Gyr_Y", "Gyr_Z")
_MAG: Final = ("Mag_X", "Mag_Y", "Mag_Z")
_QUAT: Final = ("Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3")
_MAT: Final = tuple(f"Mat[{row}][{col}]" for col in (1, 2, 3) for row in (1, 2, 3))
"""Written column by column."""
_EULER: Final = ("Roll", "Pitch", "Yaw")
_GROUPS: Final = (_ACC, _GYR, _MAG, _QUAT, _MAT, _EULER)
_TIME: Final = re.compile(r"SampleTimeFine|Year|Month|Day|Second|UTC_\w+$")
"""Columns that MT Manager leaves blank, so that a space-separated file may have lost them."""
_RATE: Final = re.compile(rb"Update Rate:\s*(\d{1,5}(?:\.\d+)?)\s*Hz")
_DEVICE: Final = re.compile(rb"DeviceId:\s*([0-9A-Fa-f]{8})")
_ID_IN_NAME: Final = re.compile(r"(?<![0-9A-Fa-f])([0-9A-Fa-f]{8})(?![0-9A-Fa-f])")
_TICK_S: Final = 1e-4
"""SampleTimeFine of MT devices counts 10 kHz ticks (Xsens low-level protocol)."""


@dataclass(frozen=True)
class _Layout:
    """Start and layout of the table."""

    comments: list[bytes]
    names: list[str]
    separator: bytes
    header_line: int


def looks_like(data: bytes) -> bool:
    """Whether the data contain the header line of an MT Manager export."""
    return _layout(data) is not None


def _layout(data: bytes) -> _Layout | None:
    comments: list[bytes] = []
    for i, line in enumerate(text.head_lines(data)):
        if line.lstrip().startswith(b"//") or not line.strip():
            comments.append(line)
            continue
        for separator in (b"\t", b",", b";", b" "):
            names = text.split(line.rstrip(separator), separator)
            has_signals = any(set(g) <= set(names) for g in _GROUPS) or {"FreeAcc_X", "VelInc_X"} & set(names)
            if has_signals and "PacketCounter" in names:
                return _Layout(comments, names, separator, i)
        return None
    return None


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> Draft:
    """Read one sensor.

    Parameters
    ----------
    data : UTF-8 text. spec : entry of the manifest for this file; overrides the rate, and units changed by
        the exporting software.

    Raises
    ------
    FormatError empty, missing_acc, gravity_removed, collapsed_columns, bad_table, ambiguous_column.
    """
    layout = _layout(data)
    if layout is None:
        raise FormatError(
            "unknown_format", f"{source} has no MT Manager header line (PacketCounter, Acc_X, …)."
        )
    device = _device_id(layout, source)
    body = text.after_lines(data, layout.header_line + 1)
    lines = text.head_lines(bytes(body[:200_000]), 2)
    if not lines or not lines[0].strip():
        raise FormatError(
            "empty", f"{source} has a header but no samples; record or export it again.", sensor=device
        )
    body, names = _row_names(body, lines[0], layout, source, device)
    body, cut = _without_cut_end(body, layout.separator)
    groups = [g for g in _GROUPS if set(g) <= set(names)]
    if _ACC not in groups:
        raise _no_acc(source, device, names)
    selection = ["PacketCounter", *(c for g in groups for c in g)]
    if "SampleTimeFine" in names:
        selection.append("SampleTimeFine")
    comma = has_decimal_comma(lines, layout.separator)
    table = text.read_columns(body, source, layout.separator, names, selection, decimal_comma=comma)
    notices = [*table.notices, *cut_notice(source, cut)]
    acc = table.stack(_ACC) * _factor(ACC_UNITS, spec.acc_unit if spec else None)
    gyr = _stack_known(table, _GYR, groups, _factor(GYR_UNITS, spec.gyr_unit if spec else None))
    if gyr is None:
        notices.append(_no_gyr(source, device))
    if not np.isfinite(acc).any():
        raise _no_acc(source, device, names)
    draft = Draft(
        device_id=device,
        source=source,
        clock="counter",
        ticks=table.values["PacketCounter"],
        acc=acc,
        gyr=gyr,
        mag=_stack_known(table, _MAG, groups),
        quat=_orientation(table, groups),
        rate_hz=_rate(layout, table, spec),
        notices=tuple(replace(n, sensor=device) for n in notices),
    )
    if not np.isfinite(draft.ticks).any():
        raise FormatError("empty", f"{source} has no packet counter values; export it again.", sensor=device)
    return draft


def _stack_known(
    table: text.Columns, group: tuple[str, ...], groups: list[tuple[str, ...]], factor: float = 1.0
) -> Floats | None:
    """The columns of a signal as an array; None if absent or without any value."""
    if group not in groups:
        return None
    signal = table.stack(group) * factor
    return signal if np.isfinite(signal).any() else None


def _no_gyr(source: str, device: str) -> Notice:
    return Notice(
        "missing_gyro",
        f"{source} has no gyroscope signal, so nothing can be computed from this sensor; "
        'export it again with "rate of turn" (Gyr_X, Gyr_Y, Gyr_Z) switched on.',
        device,
    )


def cut_notice(source: str, cut: bool) -> list[Notice]:
    """Notice about a last line truncated in the middle of a number."""
    if not cut:
        return []
    return [
        Notice(
            "truncated_line",
            f"{source} ends in the middle of its last line, which was left out; copy it again.",
            severity="info",
        )
    ]


def _row_names(
    body: memoryview, first: bytes, layout: _Layout, source: str, device: str
) -> tuple[memoryview, list[str]]:
    """Names for a row's cells; it may have a trailing separator or (with spaces) have lost its blank
    cells.
    """
    names, separator = layout.names, layout.separator
    cells = first.count(separator) + 1
    if separator == b" " and cells != len(names):
        body = memoryview(re.sub(rb" +", b" ", bytes(body)))
        cells = len(first.split())
        if cells < len(names):
            return body, _right_aligned(names, cells, source, device)
    if cells == len(names) + 1 and first.rstrip(b"\r").endswith(separator):
        return body, [*names, "(blank)"]
    return body, names


def _right_aligned(names: list[str], cells: int, source: str, device: str) -> list[str]:
    """Assume that the missing cells are the blank time columns right after the counter, or reject the
    file.
    """
    lost = names[1 : 1 + len(names) - cells]
    if names[0] == "PacketCounter" and all(_TIME.match(n) for n in lost):
        return [names[0], *names[1 + len(lost) :]]
    raise FormatError(
        "collapsed_columns",
        f"{source} is separated by spaces and its rows have {cells} cells for {len(names)} columns. "
        "Which are missing cannot be told. Export it again with tab or comma as separator.",
        sensor=device,
    )


def _without_cut_end(body: memoryview, separator: bytes) -> tuple[memoryview, bool]:
    """Drop a last line without line end whose last number has fewer decimals than in the previous line.

    MT Manager always writes six decimals, so a shorter number was truncated while writing or copying.
    """
    tail = bytes(body[-20_000:])
    if tail.endswith(b"\n") or b"\n" not in tail:
        return body, False
    whole_lines, last = tail.rsplit(b"\n", 1)
    previous_cell = whole_lines.rstrip(b"\r").rsplit(b"\n", 1)[-1].rsplit(separator, 1)[-1]
    cell = last.rsplit(separator, 1)[-1]
    short = last.count(separator) == whole_lines.rsplit(b"\n", 1)[-1].count(separator) and _decimals(
        cell
    ) < _decimals(previous_cell)
    return (body[: len(body) - len(last)], True) if short else (body, False)


def _decimals(cell: bytes) -> int:
    return len(re.split(rb"[.,]", cell.strip())[-1]) if re.search(rb"[.,]", cell) else 0


def _no_acc(source: str, device: str, names: list[str]) -> FormatError:
    if "FreeAcc_X" in names:
        return FormatError(
            "gravity_removed",
            f"{source} holds only acceleration without gravity (FreeAcc); export Acc_X, Acc_Y, Acc_Z.",
            sensor=device,
        )
    return FormatError(
        "missing_acc",
        f"{source} has no acceleration columns (Acc_X, Acc_Y, Acc_Z) with values; "
        "export it again with acceleration and rate of turn.",
        sensor=device,
    )


def _device_id(layout: _Layout, source: str) -> str:
    """Serial number from the comments, else the last eight hex digits of the file name, else its stem."""
    for line in layout.comments:
        if m := _DEVICE.search(line):
            return m.group(1).decode().upper()
    stem = stem_of(source)
    ids = _ID_IN_NAME.findall(stem)
    return str(ids[-1]).upper() if ids else stem


def _rate(layout: _Layout, table: text.Columns, spec: SourceSpec | None) -> float | None:
    if spec is not None and spec.rate_hz is not None:
        return spec.rate_hz
    for line in layout.comments:
        if (m := _RATE.search(line)) and (rate := float(m.group(1))) >= 1.0:
            return rate
    fine = table.values.get("SampleTimeFine")
    if fine is None or np.count_nonzero(np.isfinite(fine)) < 10:
        return None
    packets = np.diff(table.values["PacketCounter"])
    step = np.diff(fine) / np.where(packets > 0, packets, np.nan)
    tick = float(np.nanmedian(step)) if np.isfinite(step).any() else 0.0
    return 1.0 / (tick * _TICK_S) if tick > 0 else None


def _factor(units: dict[str, float], unit: str | None) -> float:
    return 1.0 if unit is None else units[unit]


def _orientation(table: text.Columns, groups: list[tuple[str, ...]]) -> Floats | None:
    """The vendor's orientation, sensor → ENU, from any of its export forms."""
    if _QUAT in groups:
        return table.stack(_QUAT)
    if _MAT in groups:
        columns = table.stack(_MAT)
        ok = np.isfinite(columns).all(axis=1)
        out = np.full((len(columns), 4), np.nan)
        out[ok] = rotation.from_matrix(columns[ok].reshape(-1, 3, 3).swapaxes(1, 2))
        return out
    if _EULER in groups:
        roll, pitch, yaw = np.radians(table.stack(_EULER)).T
        tilt = rotation.multiply(rotation.about(1, pitch), rotation.about(0, roll))
        return rotation.multiply(rotation.about(2, yaw), tilt)
    return None
