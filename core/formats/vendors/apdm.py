"""APDM Opal: CSV of Motion Studio ("Format=7") and of Mobility Lab, all monitors in one file.

Acceleration in m/s², angular rate in rad/s and magnetic field in µT in the monitor's axes; orientation with
the scalar first. A monitor's label gives its placement (docs/reference/formats.md, "APDM").
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from sagittal.core.errors import FormatError
from sagittal.core.formats import text
from sagittal.core.formats.aliases import segment_named
from sagittal.core.formats.draft import Draft, make_draft
from sagittal.core.formats.source_spec import ACC_UNITS, GYR_UNITS, TIME_UNITS, SourceSpec

LABEL: Final = "APDM CSV"
_STUDIO: Final = b"Format=7,"
_LAB_HEADER: Final = re.compile(rb"(?m)^Time,[^\n]{1,200}/Acceleration/X,")
_LAB_RATE: Final = re.compile(rb"(?m)^Sample Rate:,\s*(\d{1,5}(?:\.\d+)?)\s*,?\s*Hz")
_LAB_LINES: Final = 20
_NUMBER: Final = re.compile(r"[-+]?\d[\d.eE+-]*")
_KINDS: Final = {
    "Accelerometer": "acc", "Acceleration": "acc", "Gyroscope": "gyr", "Angular Velocity": "gyr",
    "Magnetometer": "mag", "Magnetic Field": "mag", "Orientation": "quat",
}  # fmt: skip
_AXES: Final = {
    "acc": ("X", "Y", "Z"),
    "gyr": ("X", "Y", "Z"),
    "mag": ("X", "Y", "Z"),
    "quat": ("S", "X", "Y", "Z"),
}
_MICRO: Final = 1e-6


@dataclass(frozen=True)
class _Monitor:
    """A monitor's label and the column names of each of its signals."""

    label: str
    columns: dict[str, tuple[str, ...]]


def looks_like(data: bytes) -> bool:
    """Whether the first line is that of an APDM CSV, or there is a header line
    "Time,label/Acceleration/X".
    """
    return data.startswith(_STUDIO) or _LAB_HEADER.search(data[:8192]) is not None


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> tuple[Draft, ...]:
    """Read every monitor of a file.

    Raises
    ------
    FormatError `empty`, `bad_table`, `ambiguous_column`, `missing_acc`, `unknown_unit`.
    """
    if data.startswith(_STUDIO):
        return _read_studio(data, source, spec)
    return _read_lab(data, source, spec)


def _read_studio(data: bytes, source: str, spec: SourceSpec | None) -> tuple[Draft, ...]:
    """Three header lines: id and label of each monitor above its columns, signals, axes; time in µs."""
    lines = text.head_lines(data, 3)
    if len(lines) < 3:
        raise FormatError("empty", f"{source} has a header but no samples; export it again.")
    body = text.after_lines(data, 3)
    owners, kinds, axes = (text.split(line, b",") for line in lines)
    names, monitors = ["Time"], {}
    label, kind = "", ""
    for i, axis in enumerate(axes[1:], start=1):
        owner = owners[i] if i < len(owners) else ""
        if owner.isdigit():
            # the label stands over a later column of the same monitor
            label = next((o for o in owners[i + 1 : i + 12] if o), "") or owner
            monitors[label] = owner
        kind = (kinds[i] if i < len(kinds) else "") or kind
        names.append(f"{label}/{kind}/{axis}")
    return _read_table(names, body, source, spec, time_unit=_MICRO, rate_hz=None, ids=monitors)


def _read_lab(data: bytes, source: str, spec: SourceSpec | None) -> tuple[Draft, ...]:
    """Lines of keys, a header line "Time,label/signal/axis, …", a line of units, rows with the time in s."""
    lines = text.head_lines(data, _LAB_LINES)
    header_row = next((i for i, line in enumerate(lines) if line.startswith(b"Time,")), None)
    if header_row is None or header_row + 1 >= len(lines):
        raise FormatError("empty", f"{source} has a header but no samples; export it again.")
    names = text.split(lines[header_row], b",")
    units = text.split(lines[header_row + 1], b",")
    has_units = _NUMBER.fullmatch(units[0]) is None
    if has_units:
        _check_units(names, units, source)
    rate = _LAB_RATE.search(data[:8192])
    body = text.after_lines(data, header_row + 1 + has_units)
    named = [name.replace("/Orientation/Scalar", "/Orientation/S") for name in names]
    unit = TIME_UNITS[units[0]] if has_units else 1.0
    return _read_table(
        named, body, source, spec, time_unit=unit, rate_hz=float(rate[1]) if rate else None, ids={}
    )


def _check_units(names: Sequence[str], units: Sequence[str], source: str) -> None:
    if units[0] not in TIME_UNITS:
        raise FormatError(
            "unknown_unit",
            f"{source}: its time is in '{units[0]}', expected one of {', '.join(TIME_UNITS)}; "
            "export it again.",
        )
    for name, unit in zip(names, units, strict=False):
        expected_unit = {"Acceleration": "m/s^2", "Angular Velocity": "rad/s"}.get(
            name.split("/")[-2] if "/" in name else ""
        )
        if expected_unit is not None and unit != expected_unit:
            raise FormatError(
                "unknown_unit",
                f"{source}: column '{name}' is in '{unit}', expected {expected_unit}; export it in SI units.",
            )


def _read_table(
    names: Sequence[str],
    body: memoryview,
    source: str,
    spec: SourceSpec | None,
    *,
    time_unit: float,
    rate_hz: float | None,
    ids: dict[str, str],
) -> tuple[Draft, ...]:
    """Rows without header as one sensor per label. ids : label → the monitor's number, if known."""
    columns = text.fit_names(names, body, b",")
    monitors = _find_monitors(columns)
    if not monitors:
        raise FormatError(
            "missing_acc", f"{source} has no acceleration columns; export it again with raw data."
        )
    selection = ["Time", *(c for m in monitors for group in m.columns.values() for c in group)]
    table = text.read_columns(body, source, b",", columns, selection, decimal_comma=False)
    acc_unit = ACC_UNITS[(spec and spec.acc_unit) or "m/s2"]
    gyr_unit = GYR_UNITS[(spec and spec.gyr_unit) or "rad/s"]
    drafts = []
    for k, monitor in enumerate(monitors):
        signals = {kind: table.stack(group) for kind, group in monitor.columns.items()}
        drafts.append(
            make_draft(
                ids.get(monitor.label, monitor.label),
                source,
                "device",
                table.values["Time"] * time_unit,
                acc=signals["acc"] * acc_unit,
                gyr=signals["gyr"] * gyr_unit if "gyr" in signals else None,
                mag=signals.get("mag"),
                quat=signals.get("quat"),
                rate_hz=spec.rate_hz if spec and spec.rate_hz else rate_hz,
                # what is wrong with the table is said once
                notices=[replace(n, sensor=None) for n in table.notices] if k == 0 else (),
                segment=segment_named(monitor.label),
            )
        )
    return tuple(drafts)


def _find_monitors(columns: Sequence[str]) -> list[_Monitor]:
    """Monitors with an acceleration, in the order of the file."""
    column_set = set(columns)
    labels = dict.fromkeys(c.rsplit("/", 2)[0] for c in columns if c.count("/") >= 2)
    monitors = []
    for label in labels:
        groups = {
            kind: group
            for quantity, kind in _KINDS.items()
            if set(group := tuple(f"{label}/{quantity}/{axis}" for axis in _AXES[kind])) <= column_set
        }
        if "acc" in groups:
            monitors.append(_Monitor(label, groups))
    return monitors
