"""tracks.parquet: input for strides and parameters, stored so that they can be recomputed after an edit.

Feet: `<foot>_q_w…z`, `<foot>_valid`; their paths `<foot>_path_x…z` (m), `<foot>_path_q_w…z` where it differs,
`<foot>_path_valid`, `<foot>_still`, `<foot>_patched`; `<pelvis|chest>_acc_x…z` in the walking frame (m/s²);
`turning`. Angles and events have separate files.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa

from sagittal.core.angles import JointAngles
from sagittal.core.body.feet import FootTracks
from sagittal.core.body.model import BodyModel
from sagittal.core.events.bouts import Bout, BoutParams
from sagittal.core.events.flags import StrideParams
from sagittal.core.events.result import GaitEvents
from sagittal.core.events.steps import Step, Steps
from sagittal.core.events.turns import Turn
from sagittal.core.frames import FOOT, SEGMENTS, SIDES, Floats, Segment
from sagittal.core.parameters import Surface
from sagittal.core.parameters.measure import Tracks
from sagittal.core.signals.held_samples import cut_blocks, give_pages_back
from sagittal.server.report.files.columns import (
    SCHEMA,
    ParquetColumn,
    bools_of,
    floats_of,
    parquet_file,
    read_table,
    single_precision,
)

NAME = "tracks.parquet"

_Made = TypeVar("_Made")


def tracks_parquet(tracks: Tracks) -> bytes:
    """Write the input of `core.parameters.measure.measure_gait` other than angles and events."""
    columns: dict[str, ParquetColumn] = {}
    for segment, q in tracks.q.items():
        columns |= _spread(f"{segment}_q", q, "wxyz")
        columns[f"{segment}_valid"] = tracks.valid[segment]
    if tracks.turning is not None:
        columns["turning"] = tracks.turning
    feet = tracks.feet
    for side, p in ({} if feet is None else feet.p).items():
        assert feet is not None  # noqa: S101 (narrows the type)
        foot = FOOT[side]
        columns |= _spread(f"{foot}_path", p, "xyz")
        if foot not in tracks.q or not _are_equal(feet.q[side], tracks.q[foot]):
            columns |= _spread(f"{foot}_path_q", feet.q[side], "wxyz")
        columns[f"{foot}_path_valid"] = feet.valid[side]
        columns[f"{foot}_still"] = feet.still[side]
        if side in feet.patched:
            columns[f"{foot}_patched"] = feet.patched[side]
    for segment, a in tracks.trunk.items():
        columns |= _spread(f"{segment}_acc", a, "xyz")
    meta = {
        "schema": SCHEMA,
        "rate_hz": tracks.rate_hz,
        "params": dataclasses.asdict(tracks.params),
        "bout_params": dataclasses.asdict(tracks.bout_params),
        "surface": dataclasses.asdict(tracks.surface),
        "rests": tracks.rests,
        "standing": tracks.standing,
        "turns": [dataclasses.asdict(t) for t in tracks.turns],
        "steps": None if tracks.steps is None else _steps_meta(tracks.steps),
        "feet": None
        if feet is None
        else {
            "linked": feet.linked,
            "source": feet.source,
            "body": dataclasses.asdict(feet.body),
            "withheld": dict(feet.withheld),
            "posture": feet.posture,
            "sensor_ahead_m": dict(feet.sensor_ahead),
        },
    }
    paths = () if feet is None else (*feet.p.values(), *feet.q.values())
    return parquet_file(tracks.t_s, columns, meta, lambda: give_pages_back(paths))


def _are_equal(a: Floats, b: Floats) -> bool:
    """Whether two arrays (n, k) are equal, stopping at the first difference."""
    return a is b or all(np.array_equal(a[part], b[part]) for part in cut_blocks(len(a)))


def read_tracks(data: bytes, events: GaitEvents, angles: JointAngles | None) -> Tracks:
    """Read tracks.parquet; detected events and angles come from their own files."""
    table, meta = read_table(data)
    segments: list[Segment] = [s for s in SEGMENTS if f"{s}_valid" in table.column_names]
    trunk: list[Segment] = [s for s in SEGMENTS if f"{s}_acc_x" in table.column_names]
    q = {s: _gathered(table, f"{s}_q", "wxyz") for s in segments}
    rate = float(meta["rate_hz"])
    return Tracks(
        t_s=floats_of(table, "t_s"),
        rate_hz=rate,
        events=events,
        q=q,
        valid={s: bools_of(table, f"{s}_valid") for s in segments},
        turning=bools_of(table, "turning") if "turning" in table.column_names else None,
        feet=_feet(table, meta["feet"], rate, q),
        angles=angles,
        trunk={s: _gathered(table, f"{s}_acc", "xyz") for s in trunk},
        surface=_made(Surface, meta["surface"]),
        params=_made(StrideParams, meta["params"]),
        bout_params=_made(BoutParams, meta.get("bout_params", {})),
        rests=None if meta.get("rests") is None else tuple((a, b) for a, b in meta["rests"]),
        standing=tuple((a, b) for a, b in meta.get("standing", ())),
        turns=tuple(_made(Turn, t) for t in meta.get("turns", ())),
        steps=None if meta.get("steps") is None else _steps(meta["steps"]),
    )


def _steps_meta(steps: Steps) -> dict[str, object]:
    """Steps of a trunk sensor as JSON; their notices are in analysis.json."""
    return {
        "source": steps.source,
        "steps": [(s.time_s, s.side) for s in steps.steps],
        "bouts": [dataclasses.asdict(b) for b in steps.bouts],
    }


def _steps(meta: Mapping[str, Any]) -> Steps:
    ranges = ("breaks", "stops")
    bouts = [b | {k: tuple((x, y) for x, y in b.get(k, ())) for k in ranges} for b in meta["bouts"]]
    return Steps(
        steps=tuple(Step(t, side) for t, side in meta["steps"]),
        bouts=tuple(_made(Bout, b) for b in bouts),
        source=meta["source"],
    )


def _feet(
    table: pa.Table, meta: Mapping[str, Any] | None, rate_hz: float, q: Mapping[Segment, Floats]
) -> FootTracks | None:
    if meta is None:
        return None
    present = [side for side in SIDES if f"{FOOT[side]}_path_x" in table.column_names]
    own = {f for side in present if f"{(f := FOOT[side])}_path_q_w" in table.column_names}
    return FootTracks(
        t_s=floats_of(table, "t_s"),
        rate_hz=rate_hz,
        p={side: _gathered(table, f"{FOOT[side]}_path", "xyz") for side in present},
        q={
            side: _gathered(table, f"{f}_path_q", "wxyz") if (f := FOOT[side]) in own else q[f]
            for side in present
        },
        still={side: bools_of(table, f"{FOOT[side]}_still") for side in present},
        valid={side: bools_of(table, f"{FOOT[side]}_path_valid") for side in present},
        linked=bool(meta["linked"]),
        source=str(meta["source"]),
        body=_made(BodyModel, meta["body"]),
        withheld=meta.get("withheld", {}),
        patched={
            side: bools_of(table, name)
            for side in present
            if (name := f"{FOOT[side]}_patched") in table.column_names
        },
        posture=meta.get("posture", "standing"),
        sensor_ahead=meta.get("sensor_ahead_m", {}),
    )


def _made(kind: type[_Made], values: Mapping[str, Any]) -> _Made:
    """Create a dataclass from stored values; fields missing in older files take their defaults."""
    names = {f.name for f in dataclasses.fields(kind)}  # type: ignore[arg-type] # every kind here is a dataclass
    return kind(**{k: v for k, v in values.items() if k in names})


def _spread(name: str, values: Floats, axes: str) -> dict[str, ParquetColumn]:
    return {f"{name}_{c}": single_precision(values, i) for i, c in enumerate(axes)}


def _gathered(table: pa.Table, name: str, axes: str) -> Floats:
    return np.stack([floats_of(table, f"{name}_{c}") for c in axes], axis=1)
