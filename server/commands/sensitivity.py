"""`sagittal sensitivity`: the sensitivity analysis of a squat, in the layout of Kianifar's tables 2 and 3."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from core.errors import InputError, SagittalError
from server.storage import fs

if TYPE_CHECKING:
    from core.body.chain.geometry import LegGeometry
    from core.calibration.result import CalibratedRecording
    from core.frames import Floats, Segment
    from core.recording import UniformRecording
    from core.squat.sensitivity import SensitivityRow, SensitivityTable, SquatCase

Side = Literal["left", "right"]

HEIGHT_M = 1.75
"""Of the simulated person."""

COLUMNS = (
    "Ankle IR/ER", "Ankle Abd/Add", "Ankle Flex/Ext", "Knee Flex/Ext", "Hip Flex/Ext", "Hip Abd/Add",
    "Hip IR/ER",
)  # fmt: skip
HEADER = (
    "parameter", "angle", "nominal", "unit", "error_deg", "sensitivity_pct", "delta_relative_deg", "step",
    "delta_step_deg", "reason",
)  # fmt: skip

TABLES: tuple[tuple[str, tuple[int, ...], tuple[int, ...], str], ...] = (
    ("Ankle and knee", (0, 1, 2, 3), (0, 1, 2), "Ankle average"),
    ("Hip", (4, 5, 6), (4, 5, 6), "Hip average"),
)
"""Title, columns, the columns that are averaged, and what their average is called."""


def sensitivity(
    paths: Sequence[Path],
    reference: Path | None,
    manifest: Path | None,
    table_top: Path | None,
    side: Side | None,
    measures: Path | None,
    from_standing: bool,
    out: Path | None,
    seed: int,
) -> int:
    """Analyse a take with a reference, or a simulated one; 1 = not possible, 2 = a word is missing."""
    from core.squat.sensitivity import analyse_sensitivity

    if paths and reference is None:
        sys.stderr.write("A take needs --reference, the angles.parquet that it is held against.\n")
        return 2
    try:
        if paths and reference is not None:
            case = _read_case(paths, reference, manifest, table_top, side, measures, from_standing)
        else:
            case = simulate_case(seed, side or "right")
        table = analyse_sensitivity(case)
    except SagittalError as error:
        sys.stderr.write(f"No sensitivity ({error.code}): {error.message}\n")
        return 1
    if out is not None:
        _write(out, table)
    sys.stdout.write("\n".join(_tell(table)) + "\n")
    sys.stdout.flush()
    return 0


def simulate_case(seed: int, side: Side) -> SquatCase:
    """Half a minute of squats with noise and skin; how sensors sit and the body are known exactly."""
    from core.calibration.known_mounts import calibrate_with_mounts
    from core.simulate import RecordingSetup, SoftTissue, Squats, simulate_squats
    from core.simulate.squat_chain import draw_leg, place_sensors
    from core.squat.sensitivity import make_case
    from core.timeline import synchronise

    leg, mounts = draw_leg(HEIGHT_M, side, seed)
    made = simulate_squats(
        Squats(side=side, hinged=True, repetitions=6),
        HEIGHT_M,
        seed,
        RecordingSetup(tissue=SoftTissue()),
        place_sensors(leg, HEIGHT_M, mounts),
    )
    calibrated = calibrate_with_mounts(synchronise(made.recording), mounts, "known", 1.0)
    return make_case(calibrated, leg, made.truth.t_s, made.truth.angles, from_standing=False)


def _read_case(
    paths: Sequence[Path],
    reference: Path,
    manifest: Path | None,
    table_top: Path | None,
    side: Side | None,
    measures: Path | None,
    from_standing: bool,
) -> SquatCase:
    from core.body.chain.geometry import LegGeometry
    from core.formats import read_named_file
    from core.squat.sensitivity import make_case
    from server.report.bundle import read_angles

    take = _read_take(paths, manifest)
    leg = side or _find_side(take)
    geometry = _measure(LegGeometry.from_height(take.subject.height_m, leg), measures)
    calibrated = _calibrate(take, leg, None if table_top is None else _read_take([table_top], manifest))
    try:
        angles = read_angles(read_named_file(reference))
    except (KeyError, ValueError, OSError) as error:
        raise InputError(
            "reference_unreadable", f"{reference} is not the angles.parquet of an analysis or a simulation."
        ) from error
    offset: Mapping[str, float] = {} if from_standing else angles.zero_offset
    known = {name: values + offset.get(name, 0.0) for name, values in angles.angles.items()}
    return make_case(calibrated, geometry, angles.t_s, known, from_standing=from_standing)


def _read_take(paths: Sequence[Path], manifest: Path | None) -> UniformRecording:
    from core.formats import list_source_files, read_named_file, read_recording
    from core.formats.manifest import parse_manifest
    from core.timeline import synchronise

    declared = parse_manifest(read_named_file(manifest)) if manifest else None
    return synchronise(read_recording(list(list_source_files(paths)), declared))


def _find_side(take: UniformRecording) -> Side:
    from core.body.chain.model import leg_segments
    from core.frames import SIDES

    worn = [side for side in SIDES if set(leg_segments(side)) <= set(take.sensors)]
    if len(worn) != 1:
        raise InputError(
            "side_unknown",
            "A squat needs sensors on shank, thigh and pelvis. "
            + ("Both legs have them; say which one squats." if worn else "No leg has all of them."),
        )
    return worn[0]


def _calibrate(take: UniformRecording, side: Side, table: UniformRecording | None) -> CalibratedRecording:
    from core.calibration.fixed_offset import make_fixed_mounts
    from core.calibration.known_mounts import FIXED_OFFSET, TABLE_TOP, calibrate_with_mounts
    from core.calibration.table_top import calibrate_table_top

    if table is None:
        return calibrate_with_mounts(take, make_fixed_mounts(side), "fixed_offset", FIXED_OFFSET)
    mounts: Mapping[Segment, Floats] = calibrate_table_top(table).R_segment_sensor
    return calibrate_with_mounts(take, mounts, "table_top", TABLE_TOP)


def _measure(nominal: LegGeometry, path: Path | None) -> LegGeometry:
    """The geometry with the lengths of a JSON file put in."""
    from core.formats import read_named_file
    from core.formats.json_tree import read_json

    if path is None:
        return nominal
    try:
        given = read_json(read_named_file(path))
    except ValueError as error:
        raise InputError("measures_unreadable", f"{path} cannot be read as JSON: {error}.") from error
    names = {f.name for f in fields(nominal)} - {"side", "estimated"}
    if not isinstance(given, dict) or not set(given) <= names:
        raise InputError("measures_unreadable", f"{path} may hold {', '.join(sorted(names))}, in m.")
    if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in given.values()):
        raise InputError("measures_unreadable", f"{path} holds a length that is no number.")
    return replace(nominal, **given, estimated=not given)


def _tell(table: SensitivityTable) -> list[str]:
    from core.squat.sensitivity import average_sensitivity

    errors = ", ".join(
        f"{name} {math.degrees(e):.2f}" for name, e in zip(COLUMNS, table.errors.tolist(), strict=True)
    )
    lines = [f"RMS error with nominal values, °: {errors}.", ""]
    last = average_sensitivity([row.sensitivity_pct for row in table.rows])
    for title, columns, averaged, name in TABLES:
        lines.append(
            f"{title}: sensitivity in %, mean of ± {100.0 * table.relative:g} % of the nominal value"
        )
        lines += _table(
            (*(COLUMNS[i] for i in columns), name),
            [(row.name, _values(row.sensitivity_pct, columns, averaged, 1), row.reason) for row in table.rows]
            + [("Average", _values(last, columns, averaged, 1), None)],
        )
    for title, unit, pick in (
        (f"Change of the RMS error in °, ± {100.0 * table.relative:g} %", "", _relative),
        ("Change of the RMS error in °, by steps of", _say_steps(table), _absolute),
    ):
        lines.append(f"{title} {unit}".rstrip())
        every = tuple(range(len(COLUMNS)))
        rows = [(row.name, _values(pick(row), every, (), 3), None) for row in table.rows]
        lines += _table(COLUMNS, rows)
    if any(row.reason for row in table.rows):
        lines.append("– : nominal value 0 or near a pole; nothing can be a share of it off.")
    lines.append("Tables: docs/science/squat.md. A quotient by an error below 0.1° is not given.")
    return lines


def _relative(row: SensitivityRow) -> Floats | None:
    return None if row.relative_rad is None else np.degrees(row.relative_rad)


def _absolute(row: SensitivityRow) -> Floats | None:
    return np.degrees(row.absolute_rad)


def _say_steps(table: SensitivityTable) -> str:
    steps = {row.unit: row.step for row in table.rows}
    return f"{1000.0 * steps['m']:g} mm and {math.degrees(steps['rad']):g}°"


def _values(
    values: Floats | None, columns: tuple[int, ...], averaged: tuple[int, ...], digits: int
) -> list[str]:
    """Cells of a row, the average of some columns behind them."""
    if values is None:
        return ["–"] * (len(columns) + bool(averaged))
    chosen = [float(values[i]) for i in columns]
    if averaged:
        known = [v for v in (float(values[i]) for i in averaged) if math.isfinite(v)]
        chosen.append(sum(known) / len(known) if known else math.nan)
    return [f"{v:.{digits}f}" if math.isfinite(v) else "–" for v in chosen]


def _table(header: Sequence[str], rows: Sequence[tuple[str, list[str], str | None]]) -> list[str]:
    lines = ["".join([f"{'':<12}", *(f"{name:>15}" for name in header)])]
    lines += ["".join([f"{name:<12}", *(f"{cell:>15}" for cell in cells)]) for name, cells, _ in rows]
    return [*lines, ""]


def _write(out: Path, table: SensitivityTable) -> None:
    from core.squat.joints import JOINTS
    from server.report.columns import write_csv

    def deg(values: Floats | None, i: int) -> float | None:
        return None if values is None else math.degrees(float(values[i]))

    def size(row: SensitivityRow, value: float | None) -> float | None:
        return None if value is None else math.degrees(value) if row.unit == "rad" else value

    rows = [
        (
            row.name,
            joint,
            size(row, row.nominal),
            "deg" if row.unit == "rad" else "m",
            math.degrees(float(table.errors[i])),
            None if row.sensitivity_pct is None else float(row.sensitivity_pct[i]),
            deg(row.relative_rad, i),
            size(row, row.step),
            deg(row.absolute_rad, i),
            row.reason or "",
        )
        for row in table.rows
        for i, joint in enumerate(JOINTS)
    ]
    fs.make_folder(out.parent)
    fs.write_file(out, write_csv(HEADER, rows))
