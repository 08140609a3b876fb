"""Result files of a daily-life recording (for their content see core/activity/result.py).

activity.json              device, periods of wear, days, hours, transitions, candidates, bouts, turns
activity_spans.parquet     the entire day: start_s, end_s, kind, confidence, evidence
activity_spans.csv         the same as text
activity_inclination.parquet  t_s (whole seconds) and inclination_deg, null if unknown
activity_steps.parquet     time_s of every step
transitions.csv            transitions and candidates in order of time
walking_bouts.csv          walking bouts
activity_hours.csv         steps and minutes of each kind per hour
"""

from __future__ import annotations

import datetime as dt
import io
import json
import math
from collections.abc import Mapping
from typing import Any, Final, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from sagittal.core.activity.result import (
    KINDS,
    ActivityBout,
    ActivityDay,
    ActivityHour,
    ActivityResult,
    ActivitySpan,
    PosturalTransition,
    TransitionCandidate,
    WearPeriod,
)
from sagittal.core.errors import FormatError, Notice
from sagittal.core.events.turns import Turn
from sagittal.server.report.files.columns import (
    SCHEMA,
    floats_of,
    list_turns,
    parquet_file,
    read_table,
    reduce_to_plain,
    write_csv,
)

NAME: Final = "activity.json"
SPANS: Final = "activity_spans.parquet"
INCLINATION: Final = "activity_inclination.parquet"
STEPS: Final = "activity_steps.parquet"


def write_activity(result: ActivityResult) -> dict[str, bytes]:
    """Write the result of activity monitoring as files, name → bytes."""
    return {
        NAME: json.dumps(summarise_activity(result), ensure_ascii=False, allow_nan=False, indent=1).encode(),
        SPANS: _spans_parquet(result.spans),
        INCLINATION: parquet_file(
            np.arange(len(result.inclination_deg), dtype=np.float64),
            {"inclination_deg": result.inclination_deg.astype(np.float32)},
            {"schema": SCHEMA, "positive": "forward"},
        ),
        STEPS: _one_column("time_s", result.steps_s),
        "activity_spans.csv": write_csv(
            ("start_s", "end_s", "kind", "confidence", "evidence"),
            ((s.start_s, s.end_s, s.kind, s.confidence, s.evidence) for s in result.spans),
        ),
        "transitions.csv": _transitions_csv(result),
        "walking_bouts.csv": write_csv(
            ("start_s", "end_s", "kind", "steps", "stairs_up_steps", "stairs_down_steps", "cadence_spm"),
            (
                (b.start_s, b.end_s, b.kind, b.steps, b.stairs_up_steps, b.stairs_down_steps, b.cadence_spm)
                for b in result.bouts
            ),
        ),
        "activity_hours.csv": write_csv(
            ("start_s", "end_s", "steps", *(f"{kind}_min" for kind in KINDS)),
            ((h.start_s, h.end_s, h.steps, *(h.minutes.get(k, 0.0) for k in KINDS)) for h in result.hours),
        ),
    }


def summarise_activity(result: ActivityResult) -> dict[str, object]:
    """Content of activity.json: everything except spans, steps and inclination, which have own files."""
    return {
        "schema": SCHEMA,
        "segment": result.segment,
        "device_id": result.device_id,
        "source": result.source,
        "rate_hz": result.rate_hz,
        "has_gyro": result.has_gyro,
        "started_at": None if result.started_at is None else result.started_at.isoformat(),
        "duration_s": result.duration_s,
        "height_m": result.height_m,
        "steps": len(result.steps_s),
        "minutes": {kind: result.minutes(kind) for kind in KINDS},
        "sub_threshold": len(result.sub_threshold),
        "periods": [_plain(p) for p in result.periods],
        "days": [{**_plain(d), "date": None if d.date is None else d.date.isoformat()} for d in result.days],
        "hours": [_plain(h) for h in result.hours],
        "transitions": [_plain(t) for t in result.transitions],
        "candidates": [_plain(c) for c in result.candidates],
        "bouts": [_plain(b) for b in result.bouts],
        "turns": list_turns(result.turns),
        "notices": [n.to_json() for n in result.notices],
    }


def read_activity(files: Mapping[str, bytes]) -> ActivityResult:
    """Read the files of `write_activity`.

    Raises
    ------
    FormatError : `no_activity` without activity.json, `newer_activity` if a later version wrote it.
    """
    if NAME not in files:
        raise FormatError("no_activity", "activity.json is missing; run the analysis again.")
    data = json.loads(files[NAME])
    if data.get("schema") != SCHEMA:
        raise FormatError(
            "newer_activity",
            f"activity.json has schema {data.get('schema')}, this version reads {SCHEMA}; update Sagittal.",
        )
    inclination, _ = read_table(files[INCLINATION])
    steps = pq.read_table(pa.BufferReader(files[STEPS]))
    started = data["started_at"]
    return ActivityResult(
        segment=data["segment"],
        device_id=data["device_id"],
        source=data["source"],
        rate_hz=data["rate_hz"],
        has_gyro=data["has_gyro"],
        started_at=None if started is None else dt.datetime.fromisoformat(started),
        duration_s=data["duration_s"],
        height_m=data["height_m"],
        spans=_read_spans(files[SPANS]),
        transitions=tuple(PosturalTransition(**t) for t in data["transitions"]),
        candidates=tuple(TransitionCandidate(**c) for c in data["candidates"]),
        bouts=tuple(ActivityBout(**b) for b in data["bouts"]),
        steps_s=floats_of(steps, "time_s"),
        turns=tuple(_read_turn(t) for t in data["turns"]),
        hours=tuple(ActivityHour(**h) for h in data["hours"]),
        days=tuple(_read_day(d) for d in data["days"]),
        periods=tuple(_read_period(p) for p in data["periods"]),
        inclination_deg=floats_of(inclination, "inclination_deg"),
        notices=tuple(Notice.from_json(n) for n in data["notices"]),
    )


def _transitions_csv(result: ActivityResult) -> bytes:
    """Transitions and rejected candidates, distinguished by `status`."""
    rows: list[tuple[object, ...]] = [
        (
            t.time_s,
            t.start_s,
            t.end_s,
            t.kind,
            t.lean_deg,
            t.rise_m,
            "found" if t.consistent else "inconsistent",
        )
        for t in result.transitions
    ]
    rows += [
        (c.time_s, c.start_s, c.end_s, c.likely, c.lean_deg, c.rise_m, c.refused) for c in result.candidates
    ]
    rows.sort(key=lambda row: cast("float", row[0]))
    return write_csv(("time_s", "start_s", "end_s", "kind", "lean_deg", "rise_m", "status"), rows)


def _spans_parquet(spans: tuple[ActivitySpan, ...]) -> bytes:
    table = pa.table(
        {
            "start_s": pa.array([s.start_s for s in spans], pa.float64()),
            "end_s": pa.array([s.end_s for s in spans], pa.float64()),
            "kind": pa.array([s.kind for s in spans], pa.string()),
            "confidence": pa.array([s.confidence for s in spans], pa.float64()),
            "evidence": pa.array([s.evidence for s in spans], pa.string()),
        }
    )
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()


def _read_spans(data: bytes) -> tuple[ActivitySpan, ...]:
    return tuple(ActivitySpan(**row) for row in pq.read_table(pa.BufferReader(data)).to_pylist())


def _one_column(name: str, values: np.ndarray) -> bytes:
    sink = io.BytesIO()
    pq.write_table(pa.table({name: pa.array(values, pa.float64())}), sink, compression="zstd")
    return sink.getvalue()


def _plain(value: object) -> dict[str, Any]:
    plain = reduce_to_plain(dict(vars(value)))
    assert isinstance(plain, dict)  # noqa: S101 (narrows the type; `reduce_to_plain` keeps mappings)
    return plain


def _read_day(row: dict[str, Any]) -> ActivityDay:
    date = row["date"]
    return ActivityDay(**{**row, "date": None if date is None else dt.date.fromisoformat(date)})


def _read_period(row: dict[str, Any]) -> WearPeriod:
    axes = {name: None if row[name] is None else tuple(row[name]) for name in ("up", "forward")}
    return WearPeriod(**{**row, **axes})


def _read_turn(row: dict[str, Any]) -> Turn:
    return Turn(
        row["start_s"],
        row["end_s"],
        math.radians(row["turn_angle_deg"]),
        math.radians(row["turn_peak_velocity_dps"]),
    )
