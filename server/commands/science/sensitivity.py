"""`sagittal sensitivity`: sensitivity analysis of a squat, formatted as Kianifar's tables 2 and 3."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from sagittal.core.errors import InputError, SagittalError
from sagittal.server.commands.options import Manifest, Seed
from sagittal.server.storage import fs

if TYPE_CHECKING:
    from sagittal.core.body.chain.geometry import LegGeometry
    from sagittal.core.frames import Floats, Segment
    from sagittal.core.signals.calibrated import CalibratedRecording
    from sagittal.core.signals.recording import UniformRecording
    from sagittal.core.squat.sensitivity import SensitivityTable, SquatCase

Side = Literal["left", "right"]

HEIGHT_M = 1.75
"""Body height of the simulated subject."""


def sensitivity(
    paths: Annotated[tuple[Path, ...], Parameter(metavar="PATH ...")] = (),
    /,
    *,
    reference: Path | None = None,
    manifest: Manifest = None,
    table_top: Path | None = None,
    side: Side | None = None,
    measures: Annotated[Path | None, Parameter(metavar="JSON")] = None,
    from_standing: bool = False,
    out: Annotated[Path | None, Parameter(metavar="CSV")] = None,
    seed: Seed = 1,
) -> int:
    """Analyse a trial, optionally against a reference, or a simulated one; 1 if not possible.

    Parameters
    ----------
    paths
        files of one trial (default: a simulated one)
    reference
        angles.parquet to compare the angles with (default: themselves)
    table_top
        trial in which the sensors were lifted off a table
    side
        leg to analyse (default: all with sensors)
    measures
        lengths in m (docs/science/squat.md)
    from_standing
        compare angles relative to standing
    out
        write all results to a file
    seed
        seed of the simulated trial
    """
    from sagittal.server.report.view.sensitivity import (
        sensitivity_csv,
        summarise_sensitivity,
        tell_sensitivity,
    )

    try:
        if paths:
            against = None if reference is None else str(reference)
            tables = _analyse_take(paths, reference, manifest, table_top, side, measures, from_standing)
        else:
            against, from_standing = "the simulation's truth", False
            tables = analyse_simulated(seed, side or "right")
    except SagittalError as error:
        sys.stderr.write(f"No sensitivity ({error.code}): {error.message}\n")
        return 1
    summary = summarise_sensitivity(tables, against, from_standing=from_standing)
    if out is not None:
        fs.make_folder(out.parent)
        fs.write_file(out, sensitivity_csv(summary))
    sys.stdout.write("\n".join(tell_sensitivity(summary)) + "\n")
    sys.stdout.flush()
    return 0


def analyse_simulated(seed: int, side: Side) -> dict[Side, SensitivityTable]:
    """Sensitivity analysis of `simulate_case`."""
    from sagittal.core.squat.sensitivity import analyse_sensitivity

    return {side: analyse_sensitivity(simulate_case(seed, side))}


def simulate_case(seed: int, side: Side) -> SquatCase:
    """Half a minute of squats with sensor noise and soft-tissue motion; body and alignment are known
    exactly.
    """
    from sagittal.core.calibration.known_mounts import calibrate_with_mounts
    from sagittal.core.simulate import RecordingSetup, SoftTissue, Squats, simulate_squats
    from sagittal.core.simulate.squat_chain import draw_leg, place_sensors
    from sagittal.core.squat.sensitivity import ReferenceAngles, make_case
    from sagittal.core.timeline import synchronise

    leg, mounts = draw_leg(HEIGHT_M, side, seed)
    simulation = simulate_squats(
        Squats(side=side, hinged=True, repetitions=6),
        HEIGHT_M,
        seed,
        RecordingSetup(tissue=SoftTissue()),
        place_sensors(leg, HEIGHT_M, mounts),
    )
    calibrated = calibrate_with_mounts(synchronise(simulation.recording), mounts, "known", 1.0)
    truth = ReferenceAngles(simulation.truth.t_s, simulation.truth.angles)
    return make_case(calibrated, leg, truth, from_standing=False)


def _analyse_take(
    paths: Sequence[Path],
    reference: Path | None,
    manifest: Path | None,
    table_top: Path | None,
    side: Side | None,
    measures: Path | None,
    from_standing: bool,
) -> dict[Side, SensitivityTable]:
    from sagittal.core.body.chain.geometry import LegGeometry
    from sagittal.core.formats import read_named_file
    from sagittal.core.squat.sensitivity import analyse_legs
    from sagittal.core.squat.side import find_squat_sides
    from sagittal.server.results.sensitivities import read_reference

    take = _read_take(paths, manifest)
    sides = find_squat_sides(take) if side is None else (side,)
    legs = [_measure(LegGeometry.from_height(take.subject.height_m, s), measures) for s in sides]
    calibrated = _calibrate(take, sides, None if table_top is None else _read_take([table_top], manifest))
    angles = None
    if reference is not None:
        content = read_named_file(reference)
        angles = read_reference(content, str(reference), from_standing=from_standing)
    return analyse_legs(calibrated, legs, angles, from_standing=from_standing)


def _read_take(paths: Sequence[Path], manifest: Path | None) -> UniformRecording:
    from sagittal.core.formats import list_source_files, read_named_file, read_recording
    from sagittal.core.formats.manifest import parse_manifest
    from sagittal.core.timeline import synchronise

    declared = parse_manifest(read_named_file(manifest)) if manifest else None
    return synchronise(read_recording(list(list_source_files(paths)), declared))


def _calibrate(
    take: UniformRecording, sides: Sequence[Side], table: UniformRecording | None
) -> CalibratedRecording:
    from sagittal.core.calibration.fixed_offset import make_fixed_mounts
    from sagittal.core.calibration.known_mounts import FIXED_OFFSET, TABLE_TOP, calibrate_with_mounts
    from sagittal.core.calibration.table_top import calibrate_table_top

    if table is None:
        return calibrate_with_mounts(take, make_fixed_mounts(*sides), "fixed_offset", FIXED_OFFSET)
    mounts: Mapping[Segment, Floats] = calibrate_table_top(table).R_segment_sensor
    return calibrate_with_mounts(take, mounts, "table_top", TABLE_TOP)


def _measure(nominal: LegGeometry, path: Path | None) -> LegGeometry:
    """Leg geometry with the segment lengths of a JSON file."""
    from sagittal.core.formats import read_named_file
    from sagittal.core.formats.json_tree import read_json

    if path is None:
        return nominal
    try:
        lengths = read_json(read_named_file(path))
    except ValueError as error:
        raise InputError("measures_unreadable", f"{path} cannot be read as JSON: {error}.") from error
    names = {f.name for f in fields(nominal)} - {"side", "estimated"}
    if not isinstance(lengths, dict) or not set(lengths) <= names:
        raise InputError("measures_unreadable", f"{path} may hold {', '.join(sorted(names))}, in m.")
    if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in lengths.values()):
        raise InputError("measures_unreadable", f"{path} holds a length that is no number.")
    return replace(nominal, **lengths, estimated=not lengths)
