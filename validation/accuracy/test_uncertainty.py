"""Whether value ± uncertainty holds the truth: simulated people, and the two real walks with a reference.

The errors of angles and distances were measured on these two walks (core/parameters/catalogue/errors.py), so
they show that the parts add up and not what others have; the events' were measured on other sets as well.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np

from sagittal.core.events.result import GaitEvents
from sagittal.core.frames import SIDES, Side
from sagittal.core.parameters.catalogue import CATALOGUE, list_curve_figures
from sagittal.core.parameters.kinematic import stride_figures
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.uncertainty import state_uncertainty
from sagittal.core.parameters.variability import summarise_values
from tests.helpers.gaitmap import RATE, analysed, reference_strides, true_strides
from tests.helpers.true_walks import measured_walk
from validation.accuracy import test_distances_neura as distances
from validation.accuracy import test_scores_neura as scores
from validation.figures import record

PEOPLE = ("comfortable", "hemiparetic", "drop_foot")
OTHER_ZERO = {"toe_out_deg"}
"""Measured from standing; the truth of the simulation is anatomical."""

SHARE = 0.93
"""Least share of the values of a set whose ± holds the truth: 95 % less what some fifty values may miss."""

Pair = tuple[Parameter, float]
"""A value with its uncertainty, and the truth."""


def of_people(name: str) -> list[Pair]:
    _, true, result = measured_walk(name)
    truth = {(p.name, p.side): p.mean for p in true.parameters}
    pairs = []
    for p in result.parameters:
        known_response = truth.get((p.name, p.side))
        if p.uncertainty is not None and known_response is not None and p.name not in OTHER_ZERO:
            pairs.append((p, known_response))
    return pairs


def of_angles() -> list[Pair]:
    """Figures of neura_walk over standing against Vicon, of the strides of the walk itself."""
    ours, vicon = (stride_figures(c) for c in scores.curves())
    figures = list_curve_figures()
    values, truth = [], []
    for name, sides in ours.items():
        for side, x in sides.items():
            y, variable = vicon[name][side], figures[name].variable
            still = scores.vicon().angles[f"{variable}_{side[0]}"][scores.STANDING].mean()
            zero = 0.0 if name.endswith("_rom_deg") else float(np.degrees(still))
            half = len(x) // 2  # each stride is there twice
            values.append(summarise_values(name, side, x[:half].tolist(), "deg"))
            truth.append(float(np.mean(y[:half])) - zero)
    return list(zip(state_uncertainty(values), truth, strict=True))


def of_distances() -> list[Pair]:
    ours, vicon = distances.figures()
    pairs = []
    for name in distances.LIMIT_CM:
        known_finite = np.isfinite(ours[name] + vicon[name])
        values = summarise_values(name, None, ours[name][known_finite], CATALOGUE[name].unit)
        pairs.append((state_uncertainty([values])[0], float(vicon[name][known_finite].mean())))
    return pairs


@cache
def of_gaitmap() -> list[Pair]:
    """Lengths, times and stance of the counted strides of gaitmap_foot against motion capture."""
    run = analysed()
    assert run.measured is not None
    columns, strides = run.measured.columns, run.measured.strides.strides
    pairs = []
    for side in SIDES:
        observations: dict[str, list[tuple[float, float]]] = {}
        for true, row in zip(true_strides(side), reference_strides(side), strict=True):
            for i, s in enumerate(strides):
                near = abs(s.start_s - true.first_ic_s) < 0.05 and abs(s.end_s - true.last_ic_s) < 0.05
                if s.side != side or s.excluded_reason is not None or not near:
                    continue
                time = true.last_ic_s - true.first_ic_s
                stance = float(row["tc"]) / RATE - true.first_ic_s
                truth = {"stride_length_m": true.length_m, "stride_time_s": time}
                truth |= {"gait_speed_mps": true.length_m / time}
                if 0.0 < stance < time:
                    truth |= {"stance_time_s": stance, "stance_pct": 100.0 * stance / time}
                for name, reference in truth.items():
                    value = columns[name][i]
                    if value is not None:
                        observations.setdefault(name, []).append((value, reference))
        pairs += _of_side(side, observations, run.events)
    return pairs


def _of_side(
    side: Side, observations: dict[str, list[tuple[float, float]]], events: GaitEvents | None
) -> list[Pair]:
    values = [
        summarise_values(name, side, [a for a, _ in pair], CATALOGUE[name].unit)
        for name, pair in observations.items()
    ]
    truth = [float(np.mean([b for _, b in pair])) for pair in observations.values()]
    return list(zip(state_uncertainty(values, events), truth, strict=True))


def _covered(pairs: Iterable[Pair]) -> tuple[int, int, float, str]:
    """Values that hold the truth, values, the middle |error| over U, and the worst by name."""
    ratios = {}
    for p, truth in pairs:
        assert p.mean is not None
        assert p.uncertainty is not None, p.name
        ratios[f"{p.name} {p.side or 'both'}"] = abs(p.mean - truth) / p.uncertainty
    worst = max(ratios, key=lambda name: ratios[name])
    inside = sum(r <= 1.0 for r in ratios.values())
    return inside, len(ratios), float(np.median(list(ratios.values()))), f"{worst} {ratios[worst]:.2f}"


def test_value_and_uncertainty_hold_the_truth() -> None:
    sets = {f"simulated, {name}": of_people(name) for name in PEOPLE}
    sets |= {
        "neura_walk, angles over standing": of_angles(),
        "neura_walk, distances": of_distances(),
        "gaitmap_foot, lengths and times": of_gaitmap(),
    }
    rows = []
    for title, pairs in sets.items():
        inside, n, middle, worst = _covered(pairs)
        rows.append([title, f"{inside} of {n}", f"{middle:.2f}", worst])
        assert inside >= SHARE * n, (title, worst)
    record(
        "Uncertainty: what is told holds the truth",
        ["walk", "values within ±", "error over ±, median", "largest"],
        rows,
        "± at 95 % (docs/science/uncertainty.md). Simulated people have no error of skin, shoe or Vicon: "
        "their ± is too wide, as it should be. The errors of angles and distances come from the two real "
        f"walks themselves. Limit: {100 * SHARE:.0f} % of the values of every walk.",
    )
