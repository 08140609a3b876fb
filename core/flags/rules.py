"""Limits for measured values, each with its source (docs/science/flags.md, "Rules").

A limit that we have not been able to read in its source is kept and marked unverified. Deliberately excluded:
hip abduction as a sign of circumduction (it stays normal with pelvic hiking; the foot path shows it).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.message import Message
from sagittal.core.norms.tables import WBDS, read_rows
from sagittal.core.norms.values import single_side_sd
from sagittal.core.parameters.catalogue import LIMIT_FIGURES, CurveFigure, list_curve_figures, require_entries

Kind = Literal["value", "difference", "ratio"]
Beyond = Literal["above", "below"]


@dataclass(frozen=True)
class Rule:
    """When a value exceeds its limit.

    Parameters
    ----------
    measure : name in the catalogue.
    kind : "value"; "difference" = other side − this side; "ratio" = larger side over smaller side.
    limit : None = mean ± 2 sd of the clinic's own controls. marked : a second, stricter limit.
    level : the value is meaningless without the anatomical zero.
    verified : False = "unverified cut-off": cited in the literature, original source not read.
    spread : sd of the healthy sample the limit is based on, in its unit; None for other limits.
    adults : which limit comes from the healthy adults of the angle norms: "limit", or "marked" alone; None =
    neither. The value here is for their comfortable speed; `judge_flags` uses the person's speed.
    """

    name: str
    measure: str
    kind: Kind
    beyond: Beyond
    limit: float | None
    source: str
    unit: str = "deg"
    marked: float | None = None
    level: bool = False
    verified: bool = True
    spread: float | None = None
    adults: Literal["limit", "marked"] | None = None


CURVES: Final[Mapping[str, CurveFigure]] = {
    **{name: entry.curve for name, entry in LIMIT_FIGURES.items() if entry.curve is not None},
    **list_curve_figures(),
}
"""What rules may read from the cycle curves: figures of their own (docs/science/flags.md, "Rules") and the
angle parameters."""

SWING_TO_STANCE: Final = "swing_to_stance"
"""Swing time over stance time of a side; its ratio between the sides is the overall temporal symmetry of
Patterson et al. 2008."""

_STIFF: Final = "cluster analysis of 50 people after stroke, 24 with a stiff knee, at their own speed"
"""Its abstract was read, which names no authors."""

_PRACTICE: Final = "clinical use; no confirmed source"
_CONTROLS: Final = "mean ± 2 SD of own controls"
_RATIO: Final = "Patterson et al. 2010, 95 % of healthy people; source not confirmed"
_OVERALL: Final = "Patterson et al. 2008 (Arch Phys Med Rehabil 89:304): 0.9 to 1.1 in 24 healthy people"


def _wbds(parameter: str) -> tuple[float, float, float]:
    """Mean, sd of both sides' mean, and sd of left − right, of one row, all adults."""
    row = next(r for r in read_rows("kinematic_parameters_wbds") if r["parameter"] == parameter)
    return float(row["all_mean"]), float(row["all_std"]), float(row["LR_diff_sd"])


def _above_norm(name: str, measure: str, parameter: str, *, level: bool) -> Rule:
    mean, sd, apart = _wbds(parameter)
    sd = single_side_sd(sd, apart)
    return Rule(
        name, measure, "value", "above", mean + 2.0 * sd, f"mean + 2 SD, {WBDS}", level=level, spread=sd,
        adults="limit",
    )  # fmt: skip


def _below_norm(parameter: str) -> float:
    """Mean − 2 sd of a single side."""
    mean, sd, apart = _wbds(parameter)
    return mean - 2.0 * single_side_sd(sd, apart)


def _apart(joint: str, variable: str, parameter: str) -> Rule:
    limit = 2.0 * _wbds(parameter)[2]
    source = Message("2 SD of left − right, {WBDS}", WBDS=WBDS)
    return Rule(
        f"{joint}_range_asymmetry", f"{variable}_rom_deg", "difference", "above", limit, source,
        adults="limit",
    )  # fmt: skip


RULES: Final[tuple[Rule, ...]] = (
    Rule("stiff_knee", "knee_flexion_peak_swing_deg", "difference", "above", 17.0, _STIFF),
    Rule("low_knee_flexion_swing", "knee_flexion_peak_swing_deg", "value", "below", 44.3, _STIFF, level=True),
    Rule(
        name="knee_hyperextension",
        measure="knee_flexion_min_stance_deg",
        kind="value",
        beyond="below",
        # not 0°: 45 % of healthy sides pass it, as the zero of a knee depends on the protocol by 5°
        limit=-5.0,
        source=Message("{PRACTICE}; second limit: mean − 2 SD of healthy adults", PRACTICE=_PRACTICE),
        marked=_below_norm("knee_min_stance(20-60%)"),
        level=True,
        verified=False,
        adults="marked",
    ),
    Rule(
        name="low_dorsiflexion_swing",
        measure="ankle_dorsiflexion_max_swing_deg",
        kind="value",
        beyond="below",
        limit=0.0,
        source=_PRACTICE,
        level=True,
        verified=False,
    ),
    Rule("flat_contact", "foot_pitch_ic_deg", "value", "below", 0.0, _PRACTICE, verified=False),
    Rule("low_toe_clearance", "min_toe_clearance_m", "value", "below", None, _CONTROLS, "m"),
    Rule("circumduction", "circumduction_m", "value", "above", None, _CONTROLS, "m"),
    _above_norm(
        "hip_hiking", "pelvis_obliquity_max_swing_deg", "pelvis_obliquity_swing_max(60-100%)", level=False
    ),
    _above_norm("low_hip_extension", "hip_flexion_min_deg", "hip_extension_peak", level=True),
    _apart("hip", "hip_flexion", "hip_sagittal_ROM"),
    _apart("knee", "knee_flexion", "knee_sagittal_ROM"),
    _apart("ankle", "ankle_dorsiflexion", "ankle_ROM"),
    Rule("step_length_asymmetry", "step_length_m", "ratio", "above", 1.08, _RATIO, "", verified=False),
    Rule("stance_asymmetry", "stance_time_s", "ratio", "above", 1.05, _RATIO, "", verified=False),
    Rule("swing_asymmetry", "swing_time_s", "ratio", "above", 1.06, _RATIO, "", verified=False),
    Rule("temporal_asymmetry", SWING_TO_STANCE, "ratio", "above", 1.1, _OVERALL, ""),
)
"""In the order of a report: knee, ankle and foot, pelvis and hip, sides against each other."""

require_entries((rule.measure for rule in RULES), "sagittal.core.flags.rules")

PERRY_MPS: Final = (0.4, 0.8)
"""Speeds between the classes of walking after stroke: Perry et al. 1995 (docs/science/flags.md)."""

Ambulation = Literal["household", "limited_community", "community"]


def classify_ambulation(speed_mps: float) -> Ambulation:
    """Ambulation class after stroke: below 0.4, up to 0.8, above 0.8 m/s."""
    if speed_mps < PERRY_MPS[0]:
        return "household"
    return "limited_community" if speed_mps <= PERRY_MPS[1] else "community"
