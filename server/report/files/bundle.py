"""Reads the result files of an analysis back into objects."""

from __future__ import annotations

import csv
import io
import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, cast

import numpy as np

from sagittal.core.activity.result import ActivityResult
from sagittal.core.angles import JointAngles
from sagittal.core.body.model import BodyModel
from sagittal.core.body.poses import Poses
from sagittal.core.errors import FormatError, Notice
from sagittal.core.events.edits import Edit, EditKind
from sagittal.core.events.result import EventKind, GaitEvent, GaitEvents, Stride, StrideFlag, Strides
from sagittal.core.events.strides import NOTICES
from sagittal.core.frames import SEGMENTS, Segment, Side
from sagittal.core.message import Message, join_messages
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.catalogue.entry import FUNCTIONAL
from sagittal.core.parameters.measure import MeasuredGait
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import Column
from sagittal.server.report.files import activity_files
from sagittal.server.report.files.columns import SCHEMA, bools_of, floats_of, read_table
from sagittal.server.report.files.exports import STRIDE_COLUMNS

EDIT_WORDS: Final[Mapping[EditKind, tuple[str, str]]] = {
    "move_event": ("event moved", "events moved"),
    "add_event": ("event added", "events added"),
    "delete_event": ("event deleted", "events deleted"),
    "exclude_stride": ("stride excluded", "strides excluded"),
    "include_stride": (
        "stride included despite an exclusion rule",
        "strides included despite an exclusion rule",
    ),
}
"""Kind of edit → words for singular and plural."""


ABOUT_FILES: Final = frozenset({"ignored_file", "file_not_read", "file_given_twice"})
"""Codes of notices about unused files of an upload, which the upload page lists."""


@dataclass(frozen=True)
class StoredRepetition:
    """A squat of repetitions.csv; values : measure → number, empty if it is excluded."""

    side: Side
    start_s: float
    end_s: float
    values: Mapping[str, float]
    excluded: str | None


@dataclass(frozen=True, eq=False)
class Bundle:
    """A finished analysis as stored; stages that were not reached are None or empty.

    Parameters
    ----------
    repetitions : of squats, otherwise None. functional : of a functional test, as in analysis.json, otherwise
        None. activity : of a daily-life recording, otherwise None.
    quality, calibration, calibration_score, estimator, provenance : the JSON of analysis.json.
    warnings : its notices, except those already shown on the upload page.
    """

    quality: Mapping[str, Any]
    calibration: Mapping[str, Any] | None
    parameters: tuple[Parameter, ...]
    warnings: tuple[Notice, ...]
    provenance: Mapping[str, Any]
    calibration_score: Mapping[str, Any] | None = None
    estimator: Mapping[str, Any] | None = None
    angles: JointAngles | None = None
    events: GaitEvents = field(default_factory=lambda: GaitEvents(()))
    strides: Strides = field(default_factory=lambda: Strides(()))
    repetitions: tuple[StoredRepetition, ...] | None = None
    functional: Mapping[str, Any] | None = None
    activity: ActivityResult | None = None


def load_bundle(files: Mapping[str, bytes]) -> Bundle:
    """Read the files of `analysis_files`, except poses, which only the replay needs (`read_poses`).

    Raises
    ------
    FormatError
        `no_analysis` without analysis.json, `newer_analysis` if a later version wrote it.
    """
    if "analysis.json" not in files:
        raise FormatError("no_analysis", "analysis.json is missing; run the analysis again.")
    data = json.loads(files["analysis.json"])
    if data.get("schema") != SCHEMA:
        raise FormatError(
            "newer_analysis",
            f"analysis.json has schema {data.get('schema')}, this version reads {SCHEMA}; update Sagittal.",
        )
    return Bundle(
        quality=data["quality"],
        calibration=data["calibration"],
        parameters=tuple(Parameter(**row) for row in data["parameters"]),
        warnings=read_warnings(data),
        provenance=data["provenance"],
        calibration_score=data.get("calibration_score"),
        estimator=data.get("estimator"),
        angles=read_angles(files["angles.parquet"]) if "angles.parquet" in files else None,
        events=read_events(files["events.csv"]) if "events.csv" in files else GaitEvents(()),
        strides=read_strides(files["strides.csv"]) if "strides.csv" in files else Strides(()),
        repetitions=read_repetitions(files["repetitions.csv"]) if "repetitions.csv" in files else None,
        functional=data.get("functional"),
        activity=activity_files.read_activity(files) if activity_files.NAME in files else None,
    )


def read_repetitions(data: bytes) -> tuple[StoredRepetition, ...]:
    """Squats of repetitions.csv in order of time."""
    repetitions = []
    for row in csv.DictReader(io.StringIO(data.decode())):
        side, start, end = cast("Side", row.pop("side")), float(row.pop("start_s")), float(row.pop("end_s"))
        excluded = row.pop("excluded_reason") or None
        values = {name: float(x) for name, x in row.items() if name != "bottom_s" and x}
        repetitions.append(StoredRepetition(side, start, end, values, excluded))
    return tuple(repetitions)


def read_warnings(data: Mapping[str, Any]) -> tuple[Notice, ...]:
    """Notices of analysis.json about the trial, without those about unused files, shown on the upload
    page.
    """
    return keep_told(Notice.from_json(row) for row in data["warnings"])


def keep_told(notices: Iterable[Notice]) -> tuple[Notice, ...]:
    """Notices to be shown with an analysis, one for each fault."""
    hidden_codes = {*ABOUT_FILES, "duplicate_stream"}
    return join_faults(tuple(n for n in notices if n.severity == "error" or n.code not in hidden_codes))


FAILURE_CAUSES: Final = ("unequal_lengths", "channel_stuck", "gap")
"""Causes of a failed sensor (`sensor_failed`), the most specific first."""

FAILURE_EFFECTS: Final = ("foot_missing", "figure_incomplete")
"""Results missing because of that sensor."""


def join_faults(notices: Sequence[Notice]) -> tuple[Notice, ...]:
    """Merge the notices about one failed sensor into one: the cause of the failure, then its consequences."""
    failed = {n.sensor for n in notices if n.code == "sensor_failed"}
    causes: dict[str | None, Notice] = {}
    for code in FAILURE_CAUSES:
        for n in notices:
            if n.code == code and n.sensor in failed:
                causes.setdefault(n.sensor, n)
    joined = []
    for n in notices:
        if n.severity != "error" and n.sensor in failed and n.code in (*FAILURE_CAUSES, *FAILURE_EFFECTS):
            continue
        cause = causes.get(n.sensor) if n.code == "sensor_failed" else None
        if cause is not None:
            n = replace(n, message=join_messages(cause.message, n.message), t_s=cause.t_s)
        joined.append(n)
    return tuple(joined)


def apply_review(bundle: Bundle, measured: MeasuredGait, edits: Sequence[Edit]) -> Bundle:
    """Apply the result of a user's edits to an analysis, and add a notice about them."""
    done = Counter(EDIT_WORDS[e.kind] for e in edits)
    notice = Notice(
        "edited",
        Message(
            "Manual changes: {join}. The stored analysis is unchanged; its files are from before the "
            "changes.",
            join=", ".join(f"{n} {words[n > 1]}" for words, n in done.items()),
        ),
        severity="info",
    )
    warnings = [n for n in bundle.warnings if n.code not in NOTICES]
    # a functional test is measured by the analysis and unaffected by edits of strides
    of_test = tuple(p for p in bundle.parameters if is_functional(p.name))
    return replace(
        bundle,
        events=measured.events,
        strides=measured.strides,
        parameters=(*of_test, *measured.parameters),
        warnings=(*warnings, *measured.notices, notice),
        provenance={**bundle.provenance, "edits": len(edits)},
    )


def is_functional(name: str) -> bool:
    """Whether a parameter belongs to a functional test."""
    entry = CATALOGUE.get(name)
    return entry is not None and entry.group in FUNCTIONAL


def read_angles(data: bytes) -> JointAngles:
    """Joint angles of angles.parquet in rad; null becomes NaN."""
    table, meta = read_table(data)
    angles_rad = {
        name.removesuffix("_deg"): np.radians(floats_of(table, name))
        for name in table.column_names
        if name != "t_s"
    }
    headings = {name: angles_rad.pop(name) for name in tuple(angles_rad) if name.endswith("_heading")}
    zero = {name: math.radians(offset) for name, offset in meta["zero_offset_deg"].items()}
    standing = dict(meta.get("standing_angles_deg", {}))
    return JointAngles(
        floats_of(table, "t_s"),
        angles_rad,
        zero,
        meta["angle_zero"],
        diagnostics={"estimated": tuple(meta.get("estimated", ()))},
        standing_deg=standing,
        withheld=dict(meta.get("withheld", {})),
        bounds={name: math.radians(bound) for name, bound in meta.get("bounds_deg", {}).items()},
        headings={name.removesuffix("_heading"): course for name, course in headings.items()},
    )


def read_poses(data: bytes) -> Poses:
    """Segment poses of poses.parquet."""
    table, meta = read_table(data)
    present: list[Segment] = [s for s in SEGMENTS if f"{s}_q_w" in table.column_names]
    return Poses(
        t_s=floats_of(table, "t_s"),
        rate_hz=float(meta["rate_hz"]),
        q={s: np.stack([floats_of(table, f"{s}_q_{c}") for c in "wxyz"], axis=1) for s in present},
        p={s: np.stack([floats_of(table, f"{s}_p_{c}") for c in "xyz"], axis=1) for s in present},
        valid=bools_of(table, "valid"),
        contact={
            cast("Segment", f"foot_{k}"): bools_of(table, f"contact_{k}")
            for k in "lr"
            if f"contact_{k}" in table.column_names
        },
        body=BodyModel(**meta["body"]),
        method=str(meta["method"]),
    )


def read_events(data: bytes) -> GaitEvents:
    """Contacts of events.csv; the detection time is not stored and is set to the event time."""
    return GaitEvents(
        tuple(
            GaitEvent(
                time_s=(t := float(row["time_s"])),
                side=cast("Side", row["side"]),
                kind=cast("EventKind", row["kind"]),
                source=row["source"],
                detected_s=t,
                confidence=_number(row.get("confidence") or ""),
                uncertainty_s=_number(row.get("uncertainty_s") or ""),
            )
            for row in _rows(data)
        )
    )


def read_strides(data: bytes) -> Strides:
    """Strides of strides.csv, without the derived parameter columns."""
    return Strides(
        tuple(
            Stride(
                side=cast("Side", row["side"]),
                start_s=float(row["start_s"]),
                tc_s=_number(row["tc_s"]),
                end_s=float(row["end_s"]),
                opposite_tc_s=_number(row["opposite_tc_s"]),
                opposite_ic_s=_number(row["opposite_ic_s"]),
                turn_rad=None if (turn := _number(row["turn_deg"])) is None else math.radians(turn),
                excluded_reason=row["excluded_reason"] or None,
                flags=cast("tuple[StrideFlag, ...]", tuple((row.get("flags") or "").split())),
            )
            for row in _rows(data)
        )
    )


def read_columns(data: bytes) -> dict[str, Column]:
    """Parameters of strides.csv by name, one value per stride."""
    rows = list(_rows(data))
    columns_known = {*STRIDE_COLUMNS, "flags", "excluded_reason"}
    names = [name for name in (rows[0] if rows else ()) if name not in columns_known]
    return {name: tuple(_number(row[name]) for row in rows) for name in names}


def _rows(data: bytes) -> csv.DictReader[str]:
    return csv.DictReader(io.StringIO(data.decode()))


def _number(text: str) -> float | None:
    return float(text) if text else None
