"""Result files of a filter comparison, for page and downloads.

filters.json       everything: filters, spread over time and cycle, reference, provenance (schema 1)
filters.csv        one row per filter: cost and agreement
spread.csv         one row per quantity and side: over the take, in stance, in swing
spread_cycle.csv   spread over the gait cycle, one column per quantity and side
spread_time.csv    spread over time
reference.csv      one row per filter and quantity: RMSE and Bland–Altman; with a reference only
orientations.parquet  one row per filter, segment and sample: segment to W
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa

from sagittal.core.filter_comparison.result import (
    FilterAgreement,
    FilterComparison,
    FilterSpread,
    ReferenceScores,
)
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.benchmark import OrientationScore
from sagittal.core.fusion.algorithms.listed import BY_NAME
from sagittal.server.report.files.columns import (
    SCHEMA,
    parquet_file,
    reduce_to_plain,
    repeat_words,
    write_csv,
)

BINS: Final = 400
"""Maximum number of points of a curve over time."""

MOST_ROWS: Final = 1_000_000
"""Of orientations.parquet, some 15 MB: larger ones are decimated to every second, third … sample."""

SCORES: Final = ("total", "heading", "inclination")


def filter_run_files(comparison: FilterComparison) -> dict[str, bytes]:
    """File name → content, angles in degrees."""
    t_s = bin_values(comparison.t_s, np.nanmean)
    files = {
        "filters.json": _json(comparison, t_s),
        "filters.csv": _filters_csv(comparison.filters),
        "spread.csv": _spread_csv(comparison.spreads),
        "spread_cycle.csv": _cycle_csv(comparison.spreads),
        "spread_time.csv": _time_csv(comparison.spreads, t_s),
        "orientations.parquet": orientations_parquet(comparison),
    }
    if comparison.reference is not None:
        files["reference.csv"] = _reference_csv(comparison, comparison.reference)
    return files


def orientations_parquet(comparison: FilterComparison, most_rows: int = MOST_ROWS) -> bytes:
    """Orientations as Parquet: `t_s` (float64), `segment`, `filter`, `qw` … `qz` (float32), null if lost.

    The metadata entry `sample_step` gives the decimation: all samples (1), every second (2) …
    """
    parts = [
        (f.label, s, q)
        for f in comparison.filters
        for s, q in comparison.orientations.get(f.name, {}).items()
    ]
    step = max(1, -(-len(comparison.t_s) * len(parts) // most_rows))
    t_s = comparison.t_s[::step]
    q = np.empty((len(parts), len(t_s), 4), np.float32)
    for k, (_, s, orientation) in enumerate(parts):
        q[k] = np.where(comparison.valid[s][::step, None], orientation[::step], np.nan)
    columns: dict[str, np.ndarray | pa.Array[Any]] = {
        "segment": repeat_words([s for _, s, _ in parts], len(t_s)),
        "filter": repeat_words([name for name, _, _ in parts], len(t_s)),
        **{f"q{c}": q[:, :, i].ravel() for i, c in enumerate("wxyz")},
    }
    return parquet_file(np.tile(t_s, len(parts)), columns, {"schema": SCHEMA, "sample_step": step})


def bin_values(values: Floats, reduce: Any) -> Floats:
    """Reduce values to at most BINS bins with a function that ignores NaN; NaN where all values are."""
    size = -(-len(values) // BINS)
    padded = np.pad(values, (0, -len(values) % size), constant_values=np.nan).reshape(-1, size)
    out = np.full(len(padded), np.nan)
    finite = np.isfinite(padded).any(axis=1)
    out[finite] = reduce(padded[finite], axis=1)
    return out


def _rms(values: Floats, axis: int) -> Floats:
    return np.asarray(np.sqrt(np.nanmean(values**2, axis=axis)))


def _json(comparison: FilterComparison, t_s: Floats) -> bytes:
    content = {
        "schema": SCHEMA,
        "filters": [_row(f) for f in comparison.filters],
        "magnetometer": comparison.request.magnetometer,
        "segments": comparison.segments,
        "strides": comparison.strides,
        "t_s": np.round(t_s, 3),
        "spreads": [_spread(s) for s in comparison.spreads],
        "reference": None if comparison.reference is None else _reference(comparison.reference),
        "notices": [n.to_json() for n in comparison.notices],
    }
    return json.dumps(reduce_to_plain(content), ensure_ascii=False, allow_nan=False).encode()


def _row(f: FilterAgreement) -> dict[str, object]:
    listed = BY_NAME.get(f.name or "")
    return {
        "name": f.name,
        "label": f.label,
        "engine": None if listed is None else listed.engine,
        "grade": None if listed is None else listed.grade,
        "cost_us": None if f.cost_us is None else round(f.cost_us, 3),
        "to_median": _score(f.to_median),
        "to_own": _score(f.to_own),
        "segments": {s: _score(score) for s, score in f.segments.items()},
        "told": [n.to_json() for n in f.told],
    }


def _score(score: OrientationScore | None) -> dict[str, float] | None:
    """Convert to degrees; None remains None."""
    return None if score is None else {name: _deg(getattr(score, name)) for name in SCORES}


def _deg(angle: float) -> float:
    return round(math.degrees(angle), 3)


def _degs(angles: Floats) -> Floats:
    return np.asarray(np.round(np.degrees(angles), 3))


def _spread(s: FilterSpread) -> dict[str, object]:
    return {
        "name": s.name,
        "filters": s.filters,
        "rms": _deg(s.rms),
        "largest": _deg(float(np.nanmax(s.range))),
        "sd": _degs(bin_values(s.sd, _rms)),
        "range": _degs(bin_values(s.range, np.nanmax)),
        "cycle_sd": {side: _degs(curve) for side, curve in s.cycle_sd.items()},
        "stance": {side: None if x is None else _deg(x) for side, x in s.stance.items()},
        "swing": {side: None if x is None else _deg(x) for side, x in s.swing.items()},
    }


def _reference(r: ReferenceScores) -> dict[str, object]:
    return {
        "source": r.source,
        "lag_s": round(r.lag_s, 4),
        "correlation": round(r.correlation, 4),
        "segments": r.segments,
        "scores": [
            {"filter": name, "segment": s, **(_score(score) or {})}
            for name, by_segment in r.scores.items()
            for s, score in by_segment.items()
        ],
        "agreement": [
            {
                "filter": b.filter,
                "quantity": b.quantity,
                "n": b.n,
                **{name: _deg(getattr(b, name)) for name in ("bias", "low", "high", "rmse")},
                "middle": _degs(b.middle),
                "difference": _degs(b.difference),
            }
            for b in r.agreement
        ],
        "notices": [n.to_json() for n in r.notices],
    }


def _filters_csv(filters: Sequence[FilterAgreement]) -> bytes:
    header = ["filter", "engine", "grade", "cost_us_per_sample"]
    header += [f"{name}_to_{reference_name}_deg" for reference_name in ("median", "own") for name in SCORES]
    rows = []
    for f in filters:
        row = _row(f)
        scores = [x or {} for x in (_score(f.to_median), _score(f.to_own))]
        problems = " ".join(f"{n.sensor}: {n.message}" if n.sensor else n.message for n in f.told)
        values = [score.get(name) for score in scores for name in SCORES]
        rows.append((f.label, row["engine"], row["grade"], f.cost_us, *values, problems))
    return write_csv([*header, "told"], rows)


def _spread_csv(spreads: Sequence[FilterSpread]) -> bytes:
    def rows() -> Iterator[Sequence[object]]:
        for s in spreads:
            whole, largest = _deg(s.rms), _deg(float(np.nanmax(s.range)))
            for side in s.stance or (None,):
                phases = (None if side is None else x[side] for x in (s.stance, s.swing))
                yield (
                    s.name,
                    side,
                    s.filters,
                    whole,
                    *(None if x is None else _deg(x) for x in phases),
                    largest,
                )

    header = ("quantity", "side", "filters", "sd_deg", "stance_sd_deg", "swing_sd_deg", "range_deg")
    return write_csv(header, rows())


def _cycle_csv(spreads: Sequence[FilterSpread]) -> bytes:
    curves = {f"{s.name}_{side}_sd_deg": _degs(c) for s in spreads for side, c in s.cycle_sd.items()}
    rows = ((percent, *(c[percent] for c in curves.values())) for percent in range(101))
    return write_csv(["percent_of_gait_cycle", *curves], rows if curves else ())


def _time_csv(spreads: Sequence[FilterSpread], t_s: Floats) -> bytes:
    columns = {
        f"{s.name}_{statistic}_deg": _degs(bin_values(values, reduce))
        for s in spreads
        for statistic, values, reduce in (("sd", s.sd, _rms), ("range", s.range, np.nanmax))
    }
    rows = ((t, *(c[i] for c in columns.values())) for i, t in enumerate(t_s))
    return write_csv(["t_s", *columns], rows)


def _reference_csv(comparison: FilterComparison, r: ReferenceScores) -> bytes:
    """Agreement with the reference: RMSE for orientations; bias and limits as well for angles."""
    label = {f.name: f.label for f in comparison.filters}

    def rows() -> Iterator[Sequence[object]]:
        for name, by_segment in r.scores.items():
            for s, score in by_segment.items():
                for part in SCORES:
                    yield label[name], f"{s}_{part}_error", _deg(getattr(score, part)), None, None, None, None
        for b in r.agreement:
            values = (_deg(x) for x in (b.rmse, b.bias, b.low, b.high))
            yield label[b.filter], b.quantity, *values, b.n

    header = ("filter", "quantity", "rmse_deg", "bias_deg", "limit_low_deg", "limit_high_deg", "n")
    return write_csv(header, rows())
