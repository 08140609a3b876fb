"""Reference values of single parameters: angles of healthy adults, temporal parameters by age and sex."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from core.norms.tables import WBDS, WBDS_N, rows, wbds_group

Sex = Literal["female", "male"]
Pace = Literal["slow", "normal", "fast"]

ANGLES: Final[Mapping[str, str]] = {
    "hip_flexion_ic_deg": "hip_flexion_IC",
    "hip_flexion_min_deg": "hip_extension_peak",
    "hip_flexion_rom_deg": "hip_sagittal_ROM",
    "knee_flexion_ic_deg": "knee_flexion_IC",
    "knee_flexion_max_loading_deg": "knee_flexion_loading_peak(0-30%)",
    "knee_flexion_min_stance_deg": "knee_min_stance(20-60%)",
    "knee_flexion_max_swing_deg": "knee_flexion_swing_peak",
    "knee_flexion_rom_deg": "knee_sagittal_ROM",
    "ankle_dorsiflexion_ic_deg": "ankle_IC",
    "ankle_dorsiflexion_max_stance_deg": "ankle_DF_stance_peak",
    "ankle_dorsiflexion_min_deg": "ankle_PF_peak",
    "ankle_dorsiflexion_max_swing_deg": "ankle_DF_swing_peak(75-100%)",
    "ankle_dorsiflexion_rom_deg": "ankle_ROM",
}
"""Our parameter → row of kinematic_parameters_wbds.csv."""

TEMPORAL: Final[Mapping[str, str]] = {
    "stride_time_s": "stride_time_s",
    "step_time_s": "step_time_s",
    "stance_pct": "stance_pct",
    "swing_pct": "swing_pct",
    "double_support_pct": "double_support_pct",
    "single_support_pct": "single_support_pct",
    "cadence_spm": "cadence_steps_min",
    "stride_length_m": "stride_length_m",
    "step_length_m": "step_length_m",
    "step_width_m": "stride_width_m",
    "gait_speed_mps": "speed_m_s",
}
"""Our parameter → parameter of spatiotemporal_age_sex.csv."""

_LEVEL = "Not comparable: measured from the person's own standing, the reference is anatomical."
_BAND = "The range defines the pace class, it is not mean ± SD."
_FOOT_OFF = (
    "Not comparable: our foot-off is the foot's lowest pitch, about 0.07 s after a walkway's last contact."
)
"""Simulated truth: 72 ± 5 ms after the last touch; gaitmap's healthy walker has a stance of 68.6 % by it."""

_WIDTH = "Not comparable: our width takes the feet to have stood under the hips."
"""Calibration takes legs to be vertical in standing; simulated people stand closer, 4 to 9 cm too wide."""

_NOT_COMPARABLE: Final[Mapping[str, str]] = {
    "step_width_m": _WIDTH,
    "stance_pct": _FOOT_OFF,
    "swing_pct": _FOOT_OFF,
    "double_support_pct": _FOOT_OFF,
    "single_support_pct": _FOOT_OFF,
}
"""Parameter → why a walkway's reference says nothing about ours."""


@dataclass(frozen=True)
class NormValue:
    """Reference of one parameter.

    Parameters
    ----------
    mean, sd : over people, in the unit the name ends with. n : people, None where the source gives none.
    difference_sd : sd of left − right in healthy people, None if not known.
    comparable : False where our value has another zero, or where mean ± sd is not a spread; see `note`.
    """

    name: str
    mean: float
    sd: float
    n: int | None
    group: str
    source: str
    difference_sd: float | None = None
    comparable: bool = True
    note: str = ""


@dataclass(frozen=True, eq=False)
class NormValues:
    """Values by parameter, or none and the reason: "no_norm_for_age", "age_unknown", "sex_unknown"."""

    values: Mapping[str, NormValue] = field(default_factory=dict)
    reason: str | None = None


def angle_values(age: float | None) -> NormValues:
    """Reference of the angle parameters for an adult of this age (None = all adults)."""
    group = wbds_group(age)
    if group is None:
        return NormValues(reason="no_norm_for_age")
    column = "all" if group == "adult_21_84" else group
    table = {r["parameter"]: r for r in rows("kinematic_parameters_wbds")}
    values = {}
    for name, key in ANGLES.items():
        row = table[key]
        free_of_zero = name.endswith("_rom_deg")
        values[name] = NormValue(
            name=name,
            mean=float(row[f"{column}_mean"]),
            sd=float(row[f"{column}_std"]),
            n=WBDS_N[group],
            group=group,
            source=WBDS,
            difference_sd=float(row["LR_diff_sd"]),
            comparable=free_of_zero,
            note="" if free_of_zero else _LEVEL,
        )
    return NormValues(values)


def temporal_values(age: float | None, sex: Sex | None, pace: Pace = "normal") -> NormValues:
    """Reference of the spatiotemporal parameters by age (1 to 89 years), sex and pace."""
    if age is None or sex is None:
        return NormValues(reason="age_unknown" if age is None else "sex_unknown")
    letter = "F" if sex == "female" else "M"
    table = {
        r["parameter"]: r
        for r in rows("spatiotemporal_age_sex")
        if r["sex"] == letter and r["pace"] == pace and float(r["age_min"]) <= age < float(r["age_max"]) + 1
    }
    values = {}
    for name, key in TEMPORAL.items():
        if key not in table:
            continue
        row = table[key]
        note = _BAND if row["kind"] != "mean_sd" else _NOT_COMPARABLE.get(name, "")
        ages = f"{row['age_min']} to {row['age_max']} years"
        values[name] = NormValue(
            name=name,
            mean=float(row["mean"]),
            sd=float(row["sd"]),
            n=None,
            group=f"{sex}, {ages}, {pace} pace",
            source=row["source"],
            comparable=not note,
            note=note,
        )
    return NormValues(values, None if values else "no_norm_for_age")


def expected_at_speed(speed_mps: float, age: float | None) -> Mapping[str, NormValue]:
    """Step length and cadence expected at a walking speed, 0.5 to 1.5 m/s on a treadmill; empty outside.

    y = a·v^b with a log-normal residual; `sd` is its width to first order (spec/clinic.md §2).
    """
    if not 0.5 <= speed_mps <= 1.5:
        return {}
    # the source's young are 21 to 37, its older 50 to 84 years; between them all are used
    group = "All" if age is None or 40 <= age < 50 else "Young" if age < 40 else "Older"
    values = {}
    for row in rows("spatiotemporal_speed_regression_h2a"):
        name = {"StepLength": "step_length_m", "Cadence": "cadence_spm"}.get(row["y"])
        if name is None or row["group"] != group:
            continue
        mean = float(row["a"]) * speed_mps ** float(row["b"])
        values[name] = NormValue(
            name, mean, mean * float(row["resid_sd_ln"]), int(row["n"]), group.lower(), "BMClab h2a (MIT)"
        )
    return values
