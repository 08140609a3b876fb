"""All filters on one simulated and one real take, against the truth and against optical segments."""

from __future__ import annotations

import csv
from functools import cache

import numpy as np
import pytest

from sagittal.core.filter_comparison import FilterComparison, FilterRequest, compare_filters
from sagittal.core.formats.orientation_table import OrientationTable
from sagittal.core.frames import Floats, Segment
from sagittal.core.fusion.algorithms.choice import LABELS
from sagittal.core.pipeline import TakeAnalysis
from tests.data import data_folder
from tests.helpers.walks import analysed, neura_analysis, simulated
from validation.figures import record

FIRST_ROW = 1119
"""Of neura_walk, where its optical quaternions begin; 100 Hz on both."""
OPTICAL: dict[str, Segment] = {
    "RPV": "pelvis", "RTH": "thigh_r", "LTH": "thigh_l", "RSK": "shank_r", "LSK": "shank_l", "RFT": "foot_r",
    "LFT": "foot_l",
}  # fmt: skip


def compare(take: TakeAnalysis, reference: OrientationTable) -> FilterComparison:
    assert take.strides is not None
    request = FilterRequest(tuple(LABELS), magnetometer=False)
    return compare_filters(take, take.strides, request, lambda *_: None, lambda: 0.0, reference)


@cache
def on_truth() -> FilterComparison:
    _, truth = simulated("comfortable")
    return compare(
        analysed("comfortable"), OrientationTable("truth", truth.t_s, {str(s): q for s, q in truth.q.items()})
    )


@cache
def on_neura() -> FilterComparison:
    path = data_folder("neura_walk", "vicon", "S02-Trial-Walk-1.csv")
    lines = [line for line in path.read_text().splitlines() if not line.startswith("//")]
    rows = list(csv.DictReader(lines))
    q: dict[str, Floats] = {
        segment: np.array([[float(row[f"q{name}_{part}"]) for part in (1, 2, 3, 4)] for row in rows])
        for name, segment in OPTICAL.items()
    }
    t_s: Floats = 0.01 * np.arange(len(rows), dtype=np.float64)
    return compare(neura_analysis(), OrientationTable("Vicon", t_s, q))


def error_deg(result: FilterComparison, name: str | None) -> tuple[float, float] | None:
    """RMS over all segments, total and inclination; None where the filter needs a magnetometer."""
    assert result.reference is not None
    scores = list(result.reference.scores[name].values())
    if not scores:
        return None
    total, inclination = (
        float(np.degrees(np.sqrt(np.mean([getattr(s, part) ** 2 for s in scores]))))
        for part in ("total", "inclination")
    )
    return total, inclination


def test_the_reference_is_laid_where_the_trigger_says() -> None:
    truth, optical = on_truth().reference, on_neura().reference
    assert truth is not None
    assert optical is not None
    assert truth.lag_s == pytest.approx(0.0, abs=0.003)
    # the sensors were 0 to 3 samples late, by different signals
    assert optical.lag_s == pytest.approx(0.01 * FIRST_ROW + 0.015, abs=0.02)
    assert optical.correlation > 0.9


def test_every_filter_on_both_takes() -> None:
    rows: list[tuple[float, list[str]]] = []
    for name, label in ((None, "Sagittal, as analysed"), *LABELS.items()):
        errors = [error_deg(result, name) for result in (on_truth(), on_neura())]
        cells = ["–" if e is None else f"{e[0]:.1f} / {e[1]:.1f}" for e in errors]
        if errors[0] is not None:
            rows.append((errors[0][0], [label, *cells]))
    rows.sort(key=lambda row: (round(row[0], 1), row[1][0]))  # filters that are as good go by name
    knees = [
        [float(np.degrees(s.rms)) for s in result.spreads if s.name.startswith("knee_flexion")]
        for result in (on_truth(), on_neura())
    ]
    spread = " and ".join(f"{np.mean(k):.1f}°" for k in knees)
    record(
        "Filters on one take",
        ["filter", "simulated walk against truth", "neura_walk against Vicon"],
        [row for _, row in rows],
        "RMS in degrees, total / inclination, over seven segments, without magnetometer, default gains, "
        "started alike (docs/science/filter-comparison.md). Lag, world and sensor axes are fitted to the "
        "median. "
        "On neura_walk the skin markers' own error is in every figure and the same for all. "
        f"Spread of knee flexion between the filters: {spread}. Limits: as analysed 1° on the simulated "
        "walk, 0.5° from the best filter on neura_walk.",
    )
    on_true, own = error_deg(on_truth(), None), error_deg(on_neura(), None)
    assert on_true is not None
    assert own is not None
    assert on_true[0] < 1.0
    assert own[0] < min(e[0] for n in LABELS if (e := error_deg(on_neura(), n))) + 0.5
