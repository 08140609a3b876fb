"""Norms at a person's own speed: healthy adults instructed to walk equally slowly.

docs/science/norms-and-scores.md, "At the person's speed". The effect of speed is that of 52 adults who walked
overground at five speeds (Schreiber & Moissenet 2019); the level is that of the WBDS adults at their
comfortable speed, so that the two norms coincide at 1.25 m/s. Curves and discrete parameters have separate
models: in slow walking the timing of a peak varies, and the peak of the mean curve is up to 11° below the
mean of the peaks.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from math import exp, hypot, log, sqrt
from operator import itemgetter
from typing import Final

import numpy as np

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.norms.kinematics import NormBand, adult_kinematics
from sagittal.core.norms.profile import MODES, PROFILES, CurveReference, ScoreSpread
from sagittal.core.norms.speed import COMFORTABLE, SLOWEST
from sagittal.core.norms.tables import read_columns, read_rows
from sagittal.core.norms.values import NormValue, angle_values, explain_difference, single_side_sd
from sagittal.core.parameters.catalogue import CurveFigure, find_entry, require_entries

ASKED: Final = "healthy adults asked to walk at this speed"
"""Who the people are, printed beside every such norm. Who is slow from habit, being old, moves less."""

SOURCE: Final = "Schreiber & Moissenet 2019 (Sci Data 6:111), CC BY 4.0"
"""Of the effect of speed."""

N_ADULTS: Final = 52
"""Of them there are single curves of knee and ankle, and times and distances; means of 22 of the others."""

BLEND: Final = (0.15, 0.20)
"""v* below which only the mean level of the anchor is kept, and the width over which its shape comes in:
the shape of a slow curve is that of the slow people (chosen with the other sets of
docs/science/norms-and-scores.md in view)."""

HIP_SD_DEG: Final = 3.0
"""What the change of a hip figure is known to: there are no single curves of the hip."""


@dataclass(frozen=True, eq=False)
class CurveModel:
    """One variable: mean = c · [1, ln v*, (ln v*)²] of the 52 or 22 adults in their own frame.

    Parameters
    ----------
    coefficients : (101, 3), degrees. n : people.
    speeds : (m,) v*, ascending, at which the spread is known.
    spread : (m, 101), relative to that at 1.25 m/s.
    """

    coefficients: Floats
    n: int
    speeds: Floats
    spread: Floats

    def mean(self, v: float) -> Floats:
        """Mean curve (101,) at a dimensionless speed."""
        return np.asarray(self.coefficients @ _terms(v))

    def relative_sd(self, v: float) -> Floats:
        """Standard deviation (101,) relative to that at 1.25 m/s; linear between the speeds of the table."""
        upper = int(np.clip(np.searchsorted(self.speeds, v), 1, len(self.speeds) - 1))
        low, high = self.speeds[upper - 1 : upper + 1]
        share = float(np.clip((v - low) / (high - low), 0.0, 1.0))
        return np.asarray((1.0 - share) * self.spread[upper - 1] + share * self.spread[upper])


@cache
def curve_models() -> Mapping[str, CurveModel]:
    """Models by variable: knee and ankle (52 adults), hip, its adduction and the pelvis (22)."""
    spreads: dict[str, dict[float, list[float]]] = {}
    table = read_columns("norm_speed_matched_adult", "variable", "dimensionless_speed", "sd_deg")
    for (variable, speed), cells in groupby(table, key=itemgetter(0, 1)):
        values = spreads.setdefault(variable, {}).setdefault(float(speed), [])
        values.extend(float(sd) for _, _, sd in cells)
    coefficients: dict[str, tuple[list[list[float]], int]] = {}
    for r in read_rows("speed_model_coefficients"):
        if r["variable"] in spreads:
            rows, _ = coefficients.get(r["variable"], ([], 0))
            rows.append([float(r[c]) for c in ("b0", "b1_ln_v", "b2_ln_v_sq")])
            coefficients[r["variable"]] = rows, int(r["n_subjects"])
    models = {}
    for variable, (rows, n) in coefficients.items():
        own = spreads[variable]
        speeds = sorted(own)
        spread = np.array([own[v] for v in speeds])
        models[variable] = CurveModel(np.array(rows), n, np.array(speeds), spread / spread[-1])
    return models


def move_curve(curve: Floats, model: CurveModel, v: float, comfortable: float = COMFORTABLE) -> Floats:
    """Predict a mean curve (101,) at v*, 0.085 to 0.439, from that at a comfortable v*."""
    offset = curve - model.mean(comfortable)
    level = offset.mean()
    share = float(np.clip((v - BLEND[0]) / BLEND[1], 0.0, 1.0))
    return np.asarray(model.mean(v) + level + share * (offset - level))


def bands_at_speed(age: float | None, v: float) -> Mapping[str, NormBand]:
    """Reference bands at a dimensionless speed, by variable; none below 18 years.

    Parameters
    ----------
    v : v* of `WalkingSpeed.norm_speed`, 0.085 to 0.439.
    """
    bands, models = adult_kinematics(age).bands, curve_models()
    norm_bands = {}
    for variable, model in models.items():
        band = bands.get(variable)
        if band is None:
            continue
        mean, sd = move_curve(band.mean_deg, model, v), band.sd_deg * model.relative_sd(v)
        mean.setflags(write=False)
        sd.setflags(write=False)
        source = f"{SOURCE}; level: {band.source}"
        norm_bands[variable] = NormBand(
            variable, mean, sd, model.n, ASKED, source, band.zero, band.confidence, band.note
        )
    return norm_bands


_ROWS: Final[Mapping[str, str]] = {
    "knee_flexion_max_swing_deg": "knee_flexion_peak_swing",
    "knee_flexion_max_loading_deg": "knee_flexion_peak_loading",
    "knee_flexion_ic_deg": "knee_flexion_IC",
    "knee_flexion_min_stance_deg": "knee_min_stance",
    "knee_flexion_rom_deg": "knee_ROM",
    "ankle_dorsiflexion_max_stance_deg": "ankle_dorsiflexion_peak_stance",
    "ankle_dorsiflexion_min_deg": "ankle_plantarflexion_peak_pushoff",
    "ankle_dorsiflexion_max_swing_deg": "ankle_dorsiflexion_peak_swing",
    "ankle_dorsiflexion_rom_deg": "ankle_ROM",
}
"""Our figure → its row in the model of the individual figures."""

_OF_MEAN_CURVE: Final = ("hip_flexion_min_deg", "hip_flexion_rom_deg", "pelvis_obliquity_max_swing_deg")
"""Figures read from the mean curve, for want of single ones; a value at contact needs no single curves."""

require_entries((*_ROWS, *_OF_MEAN_CURVE), "sagittal.core.norms.at_speed")

_STATISTICS: Final[Mapping[str, Callable[[Floats], float]]] = {"min": np.min, "max": np.max, "range": np.ptp}

_BINS: Final = ((0.12, "loso_sd_v05_12"), (0.25, "loso_sd_v12_25"), (0.36, "loso_sd_v25_36"))
_LAST_BIN: Final = "loso_sd_v36_55"
"""v* up to which a column of spread holds, and the last one."""


def angle_values_at_speed(
    age: float | None, v: float, anatomical: Collection[str] = ()
) -> Mapping[str, NormValue]:
    """Reference of the angle parameters at a dimensionless speed; otherwise as `angle_values`.

    For knee and ankle a reference is the mean of individual parameters: the comfortable value of the person's
    age group plus the change with speed; sd is that of leave-one-out deviations.
    """
    usual = angle_values(age, anatomical).values
    rows = {r["parameter"]: r for r in read_rows("discrete_model_rehazenter52")}
    bands = bands_at_speed(age, v)
    references = {}
    for name, norm in usual.items():
        sides = norm.difference_sd or 0.0
        if (row := rows.get(_ROWS.get(name, ""))) is not None:
            change = _discrete(row, v) - _discrete(row, COMFORTABLE)
            n, sd = N_ADULTS, single_side_sd(float(row[_bin(v)]), sides)
        elif name.endswith("_ic_deg"):
            band = bands[name.removesuffix("_ic_deg")]
            usual_band = adult_kinematics(age).bands[band.variable]
            change = float(band.mean_deg[0] - usual_band.mean_deg[0])
            n, sd = band.n, norm.sd * float(band.sd_deg[0] / usual_band.sd_deg[0])
        elif name in _OF_MEAN_CURVE and (figure := _figure_of(name)).variable in bands:
            change = _read(figure, bands) - _read(figure, adult_kinematics(age).bands)
            n = bands[figure.variable].n
            grown = norm.sd * _growth(figure, bands, adult_kinematics(age).bands)
            sd = hypot(norm.sd, HIP_SD_DEG) if figure.variable == "hip_flexion" else grown
        else:
            continue
        references[name] = NormValue(
            name=name,
            mean=norm.mean + change,
            sd=sd,
            n=n,
            group=ASKED,
            source=f"{SOURCE}; level: {norm.source}",
            difference_sd=norm.difference_sd,
            comparable=norm.comparable,
            note=norm.note,
        )
    return references


def _figure_of(name: str) -> CurveFigure:
    entry = find_entry(name)
    if entry is None or entry.curve is None:
        raise KeyError(name)
    return entry.curve


def _window(figure: CurveFigure) -> slice:
    return slice(figure.start_pct, figure.end_pct + 1)


def _read(figure: CurveFigure, bands: Mapping[str, NormBand]) -> float:
    """A discrete parameter of the mean curve, degrees."""
    return float(_STATISTICS[figure.statistic](bands[figure.variable].mean_deg[_window(figure)]))


def _growth(figure: CurveFigure, bands: Mapping[str, NormBand], usual: Mapping[str, NormBand]) -> float:
    """Ratio of the spread at this speed to that at comfortable speed, at the point where a parameter is
    read.
    """
    now, usual_sd = (table[figure.variable].sd_deg[_window(figure)] for table in (bands, usual))
    return float(np.sqrt(np.mean(now**2) / np.mean(usual_sd**2)))


def walkway_values_at_speed(v: float, leg_m: float) -> Mapping[str, NormValue]:
    """Spatiotemporal references of healthy adults overground at a dimensionless speed.

    Parameters
    ----------
    leg_m : `WalkingSpeed.norm_leg_m`, used to make the speed dimensionless.

    Swing and double support follow from stance for symmetric gait: double = 2 stance − 100, single = swing =
    100 − stance. Step time is 60 / cadence; a stride is two steps.
    """
    stance, stance_sd = _spatiotemporal("stance", v)
    initial, initial_sd = _spatiotemporal("ds1", v)
    step, step_sd = _spatiotemporal("step_length_hat", v)
    cadence, cadence_sd = _spatiotemporal("cad_hat", v)
    length, per_min = exp(step) * leg_m, 60.0 * exp(cadence) * sqrt(GRAVITY / leg_m)
    figures = {
        "stance_pct": (stance, stance_sd),
        "swing_pct": (100.0 - stance, stance_sd),
        "single_support_pct": (100.0 - stance, stance_sd),
        "double_support_pct": (2.0 * stance - 100.0, 2.0 * stance_sd),
        "initial_double_support_pct": (initial, initial_sd),
        "terminal_double_support_pct": (initial, initial_sd),
        "step_length_m": (length, length * step_sd),
        "stride_length_m": (2.0 * length, 2.0 * length * step_sd),
        "cadence_spm": (per_min, per_min * cadence_sd),
        "step_time_s": (60.0 / per_min, 60.0 / per_min * cadence_sd),
        "stride_time_s": (120.0 / per_min, 120.0 / per_min * cadence_sd),
    }
    values = {}
    for name, (mean, sd) in figures.items():
        note = explain_difference(_SHARE_OF.get(name, name))
        values[name] = NormValue(name, mean, sd, N_ADULTS, ASKED, SOURCE, comparable=not note, note=note)
    return values


_SHARE_OF: Final = dict.fromkeys(
    ("initial_double_support_pct", "terminal_double_support_pct"), "double_support_pct"
)
"""Figures that no walkway table has → the one that is measured like them."""


def reference_at_speed(age: float | None, v: float, comfortable: CurveReference) -> CurveReference:
    """Reference for scoring curves at a dimensionless speed.

    Healthy people differ more from each other at slow speed. A score is the root of a mean of squared
    deviations, so its spread increases with theirs: for a variable by the RMS of the relative sd over the
    cycle, for a profile by those of its variables, weighted by the squares of their healthy scores. The
    spread of ln GPS is unchanged.
    """
    bands, models = bands_at_speed(age, v), curve_models()
    usual = adult_kinematics(age).bands
    grows = {
        name: float(np.sqrt(np.mean(band.sd_deg**2) / np.mean(usual[name].sd_deg ** 2)))
        for name, band in bands.items()
    }
    return CurveReference(
        mean_deg={name: band.mean_deg for name, band in bands.items()},
        spreads={mode: _grown(comfortable.spreads[mode], grows) for mode in MODES},
        zero=comfortable.zero,
        n=min(models[name].n for name in bands),
        group=ASKED,
        source=f"{SOURCE}; level: {comfortable.source}",
        speed_matched=True,
    )


def _grown(spreads: Mapping[str, ScoreSpread], grows: Mapping[str, float]) -> dict[str, ScoreSpread]:
    grown = {name: _times(spreads[name], factor) for name, factor in grows.items()}
    for profile, variables in PROFILES.items():
        if any(v not in grows for v in variables):
            continue
        weights = np.array([spreads[v].mean_deg ** 2 for v in variables])
        factor = float(np.sqrt(weights @ np.array([grows[v] ** 2 for v in variables]) / weights.sum()))
        for part in ("side", "overall"):
            grown[f"{profile}_{part}"] = _times(spreads[f"{profile}_{part}"], factor)
    return grown


def _times(s: ScoreSpread, factor: float) -> ScoreSpread:
    return ScoreSpread(
        mean_deg=s.mean_deg * factor,
        sd_deg=s.sd_deg * factor,
        median_deg=s.median_deg * factor,
        p75_deg=s.p75_deg * factor,
        p95_deg=s.p95_deg * factor,
        mean_ln=None if s.mean_ln is None else s.mean_ln + log(factor),
        sd_ln=s.sd_ln,
    )


def _terms(v: float) -> Floats:
    x = log(v)
    return np.array([1.0, x, x * x])


def _discrete(row: Mapping[str, str], v: float) -> float:
    return float(np.array([float(row[c]) for c in ("b0", "b1_ln_v", "b2_ln_v_sq")]) @ _terms(v))


def _bin(v: float) -> str:
    return next((column for end, column in _BINS if v < end), _LAST_BIN)


def _spatiotemporal(parameter: str, v: float) -> tuple[float, float]:
    """Mean and leave-one-subject-out sd, in the units of the fit (ln for lengths and cadence)."""
    row = next(
        r
        for r in read_rows("spatiotemporal_speed_model_rehazenter52")
        if (r["parameter"], r["model"]) == (parameter, "quad_logv")
    )
    mean = float(np.array([float(row[c]) for c in ("b0", "b1", "b2")]) @ _terms(v))
    return mean, float(row["loso_sd_vstar_below_0.32" if v < 0.32 else "loso_sd_all"])


def is_matched(v: float) -> bool:
    """Whether the reference includes healthy adults instructed to walk at this dimensionless speed, below
    comfortable.
    """
    return SLOWEST <= v < COMFORTABLE
