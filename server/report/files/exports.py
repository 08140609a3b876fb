"""Result files of an analysis, for command line, worker and downloads page.

analysis.json   quality, devices, calibration, parameters … (server/report/files/analysis_json.py)
angles.parquet  joint angles in degrees on the uniform axis
poses.parquet   segment poses for the replay
tracks.parquet  input for strides and parameters (server/report/files/tracks.py)
signals.parquet sensor signals on the common time axis (server/report/files/signals.py)
events.csv      contacts: time_s, side, kind (ic | tc), source, confidence (fraction of detectors),
                uncertainty_s (standard)
steps.csv       steps of a trunk sensor, if there are no foot sensors: time_s, side
activity…        of daily life, replacing all but the first (server/report/files/activity_files.py)
repetitions.csv squats of each leg with their measures and reasons for exclusion
strides.csv     one row per stride with its temporal parameters and reason for exclusion
repaired.json   proposed manifest after a setup error (server/results/analysing.py)

Undefined is an empty cell or null, never NaN. `sagittal.server.report.files.bundle` reads them back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import repeat
from typing import TYPE_CHECKING, Final

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.body.poses import Poses
from sagittal.core.events.result import GaitEvents, Strides
from sagittal.core.events.steps import Steps
from sagittal.core.frames import Floats
from sagittal.core.parameters.catalogue import list_names
from sagittal.core.parameters.catalogue.entry import SQUAT
from sagittal.core.parameters.rows import Column
from sagittal.core.signals.held_samples import give_pages_back
from sagittal.server.report.files import signals, tracks
from sagittal.server.report.files.activity_files import write_activity
from sagittal.server.report.files.analysis_json import summarise_analysis
from sagittal.server.report.files.columns import (
    SCHEMA,
    ParquetColumn,
    parquet_file,
    reduce_to_plain,
    single_precision,
    write_csv,
    write_json,
)

if TYPE_CHECKING:
    # these packages import numba, which the web process avoids
    from sagittal.core.pipeline import TakeAnalysis
    from sagittal.core.squat.measures import SquatSide

MEASURES: Final = list_names(SQUAT, "take")
"""Columns of a squat in repetitions.csv."""

IN_ORDER: Final = (
    "analysis.json", "poses.parquet", "events.csv", "strides.csv", "steps.csv", "repetitions.csv",
    "angles.parquet", tracks.NAME, signals.NAME,
)  # fmt: skip
"""Files in the order returned, which differs from the order of writing."""

STRIDE_COLUMNS = ("side", "start_s", "tc_s", "end_s", "opposite_tc_s", "opposite_ic_s", "turn_deg")
"""Columns of a stride; its parameters, `flags` and `excluded_reason` follow in strides.csv."""


def analysis_files(analysis: TakeAnalysis, let_go: Callable[[], None] = lambda: None) -> dict[str, bytes]:
    """Write an analysis as files, name → bytes; stages without results have no file.

    Parameters
    ----------
    let_go : called when a large object has been released.
    """
    if analysis.source.protocol == "activity":
        written = {} if analysis.activity is None else write_activity(analysis.activity)
        return {"analysis.json": write_json(summarise_analysis(analysis)), **written}
    files = {"analysis.json": write_json(summarise_analysis(analysis))}
    # objects are released after writing, unless the caller holds the analysis
    recording, poses, angles = analysis.recording, analysis.poses, analysis.angles
    measured, squats, held = analysis.measured, analysis.squats, analysis.tracks
    del analysis
    let_go()
    # objects larger in memory than as a file first
    if angles is not None:
        held = None if held is None else replace(held, angles=None)
        files["angles.parquet"] = angles_parquet(angles)
        del angles
        let_go()
    # also if a later stage stopped, since the signals show why
    files[signals.NAME] = signals.signals_parquet(recording)
    del recording
    let_go()
    if measured is not None:
        files["events.csv"] = events_csv(measured.events)
        files["strides.csv"] = strides_csv(measured.strides, measured.columns)
        if measured.steps is not None:
            files["steps.csv"] = steps_csv(measured.steps)
        del measured
    if squats is not None:
        files["repetitions.csv"] = repetitions_csv(squats)
    if held is not None:
        files[tracks.NAME] = tracks.tracks_parquet(held)
        del held
        let_go()
    # after those, since the avatar of a long trial is in a file
    if poses is not None:
        files["poses.parquet"] = poses_parquet(poses)
        del poses
        let_go()
    return {name: files[name] for name in IN_ORDER if name in files}


def angles_parquet(angles: JointAngles) -> bytes:
    """Joint angles as Parquet: `t_s` (float64) and `<name>_deg` (float32); lost samples are null."""
    columns: dict[str, ParquetColumn] = {f"{name}_deg": _degrees(a) for name, a in angles.angles.items()}
    columns |= {f"{s}_heading_deg": _degrees(a) for s, a in angles.headings.items()}
    zero = {name: math.degrees(offset) for name, offset in angles.zero_offset.items()}
    meta: dict[str, object] = {"schema": SCHEMA, "angle_zero": angles.zero, "zero_offset_deg": zero}
    if angles.withheld:
        meta["withheld"] = dict(angles.withheld)
    if angles.bounds:
        meta["bounds_deg"] = {name: math.degrees(bound) for name, bound in angles.bounds.items()}
    if angles.diagnostics.get("estimated"):
        meta["estimated"] = reduce_to_plain(angles.diagnostics["estimated"])
    if angles.standing_deg:
        meta["standing_angles_deg"] = dict(angles.standing_deg)
    return parquet_file(angles.t_s, columns, meta, lambda: give_pages_back(angles.angles.values()))


def _degrees(a: Floats) -> ParquetColumn:
    return lambda rows: np.degrees(a[rows]).astype(np.float32)


def poses_parquet(poses: Poses) -> bytes:
    """Segment poses as Parquet: per segment `<segment>_q_w…z`, `<segment>_p_x…z` (float32), masks (bool)."""
    columns: dict[str, ParquetColumn] = {}
    for segment, q in poses.q.items():
        p = poses.p[segment]
        columns |= {f"{segment}_q_{c}": single_precision(q, i) for i, c in enumerate("wxyz")}
        columns |= {f"{segment}_p_{c}": single_precision(p, i) for i, c in enumerate("xyz")}
    columns["valid"] = poses.valid
    columns |= {f"contact_{segment.removeprefix('foot_')}": c for segment, c in poses.contact.items()}
    body = {name: getattr(poses.body, name) for name in poses.body.__dataclass_fields__}
    meta = {"schema": SCHEMA, "rate_hz": poses.rate_hz, "method": poses.method, "body": body}
    held = (*poses.q.values(), *poses.p.values())
    return parquet_file(poses.t_s, columns, meta, lambda: give_pages_back(held))


def events_csv(events: GaitEvents) -> bytes:
    """All contacts in order of time."""
    return write_csv(
        ("time_s", "side", "kind", "source", "confidence", "uncertainty_s"),
        ((e.time_s, e.side, e.kind, e.source, e.confidence, e.uncertainty_s) for e in events.events),
    )


def steps_csv(steps: Steps) -> bytes:
    """Steps of a trunk sensor in order of time; the side is empty if unknown."""
    return write_csv(("time_s", "side"), ((s.time_s, s.side) for s in steps.steps))


def repetitions_csv(squats: Sequence[SquatSide]) -> bytes:
    """All squats of both legs in order of time, with the measures of the included ones."""
    rows: list[tuple[object, ...]] = []
    for leg in squats:
        included = iter(zip(*(leg.values[name].tolist() for name in leg.values), strict=True))
        for r in leg.repetitions:
            measured = next(included) if r.excluded is None else ("",) * len(MEASURES)
            rows.append((r.side, r.start_s, r.bottom_s, r.end_s, *measured, r.excluded or ""))
    rows.sort(key=lambda row: row[1:2])
    return write_csv(("side", "start_s", "bottom_s", "end_s", *MEASURES, "excluded_reason"), rows)


def strides_csv(strides: Strides, columns: Mapping[str, Column]) -> bytes:
    """All strides with their parameters and exclusion rules that apply.

    Parameters
    ----------
    columns : parameters by name, one value per stride.
    """
    own = (
        (
            s.side,
            s.start_s,
            s.tc_s,
            s.end_s,
            s.opposite_tc_s,
            s.opposite_ic_s,
            None if s.turn_rad is None else math.degrees(s.turn_rad),
        )
        for s in strides.strides
    )
    reasons = ((" ".join(s.flags), s.excluded_reason) for s in strides.strides)
    measured = zip(*columns.values(), strict=True) if columns else repeat(())
    lines = ((*o, *m, *w) for o, m, w in zip(own, measured, reasons, strict=False))
    return write_csv((*STRIDE_COLUMNS, *columns, "flags", "excluded_reason"), lines)
