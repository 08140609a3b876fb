"""Reference values of single parameters: angles of healthy adults, temporal parameters by age and sex."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from math import hypot, sqrt
from typing import Final, Literal, cast

from sagittal.core.frames import GRAVITY
from sagittal.core.message import Message
from sagittal.core.norms.speed import WBDS_MPS
from sagittal.core.norms.tables import LEVEL, WBDS, WBDS_N, read_rows, wbds_group
from sagittal.core.parameters.catalogue import CATALOGUE, LIMIT_FIGURES, NormKey, find_entry

Sex = Literal["female", "male"]
Pace = Literal["slow", "normal", "fast"]

_NOT_LEVEL = (
    "Not comparable: measured relative to the person's own standing, whereas the reference is anatomical."
)
_BAND = "The range defines the pace class; it is not mean ± SD."
_COARSE = "Not comparable: the contacts in this trial are too uncertain; use a sensor on each foot."
COARSE_S: Final = 0.05
"""Contacts less certain than this (s, in the median) put a share of the stride off by two points and more, a
reference sd. Our choice."""

_SHARES: Final = frozenset(
    ("stance_pct", "swing_pct", "double_support_pct", "single_support_pct",
     "initial_double_support_pct", "terminal_double_support_pct")
)  # fmt: skip

_WIDTH = (
    "Not comparable: walkways measure between the heels; Sagittal measures between the ankles, which is "
    "wider."
)
"""Heels lie 5 to 6 cm behind the ankles: with toes out by 7 to 10° that is 1 to 2 cm, half a reference sd."""

_DIFFERS: Final[Mapping[str | None, str]] = {None: "", "ankles": _WIDTH}
"""What is measured differently (`NormKey.differs`) → why the reference says nothing about ours."""


@dataclass(frozen=True)
class NormValue:
    """Reference of one parameter.

    Parameters
    ----------
    mean, sd : over people, for a single side of bilateral parameters, in the unit given by the end of the
        name. n : people, None if not stated in the source.
    difference_sd : sd of left − right in healthy people, None if unknown. comparable : False if our value has
        a different zero, or if mean ± sd is not a spread; see `note`.
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
    """Values by parameter, or none with the reason "no_norm_for_age", "age_unknown", "sex_unknown"."""

    values: Mapping[str, NormValue] = field(default_factory=dict)
    reason: str | None = None


def withdraw_shares(values: Mapping[str, NormValue], contacts_s: float | None) -> dict[str, NormValue]:
    """References in which phases as a percentage of the stride are comparable only with contacts known to
    `COARSE_S`.
    """
    if contacts_s is not None and contacts_s <= COARSE_S:
        return dict(values)
    return {
        name: replace(v, comparable=False, note=_COARSE) if name in _SHARES and v.comparable else v
        for name, v in values.items()
    }


def list_norm_keys(table: Literal["angles", "walkway"]) -> dict[str, NormKey]:
    """Parameters of the catalogue with a reference in a table, and their rows there."""
    return {
        name: entry.norm
        for name, entry in (*CATALOGUE.items(), *LIMIT_FIGURES.items())
        if entry.norm is not None and entry.norm.table == table
    }


def is_angle(name: str) -> bool:
    """Whether the reference of a parameter comes from the adults of the cycle curves."""
    entry = find_entry(name)
    return entry is not None and entry.norm is not None and entry.norm.table == "angles"


def angle_values(age: float | None, anatomical: Collection[str] = ()) -> NormValues:
    """Reference of the angle parameters for an adult of this age (None = all adults).

    Ranges are always comparable, levels only for the variables in `anatomical`
    (`sagittal.core.parameters.anatomical_zero`).
    """
    group = wbds_group(age)
    if group is None:
        return NormValues(reason="no_norm_for_age")
    column = "all" if group == "adult_21_84" else group
    table = {r["parameter"]: r for r in read_rows("kinematic_parameters_wbds")}
    values = {}
    for name, key in list_norm_keys("angles").items():
        row = table[key.row]
        comparable = name.endswith("_rom_deg") or any(name.startswith(f"{v}_") for v in anatomical)
        values[name] = NormValue(
            name=name,
            mean=float(row[f"{column}_mean"]),
            sd=single_side_sd(float(row[f"{column}_std"]), float(row["LR_diff_sd"])),
            n=WBDS_N[group],
            group=group,
            source=WBDS,
            difference_sd=float(row["LR_diff_sd"]),
            comparable=comparable,
            note=_NOT_LEVEL if not comparable else "" if name.endswith("_rom_deg") else LEVEL,
        )
    return NormValues(values)


def single_side_sd(mean_sd: float, difference_sd: float) -> float:
    """sd of one side between people from the sd of their mean of both sides and of left − right.

    The table has the sd of the mean of both sides, which is smaller than that of a single side: var(side) =
    var(mean) + var(left − right) / 4, averaged over the sides.
    """
    return hypot(mean_sd, 0.5 * difference_sd)


def temporal_values(age: float | None, sex: Sex | None, pace: Pace = "normal") -> NormValues:
    """Reference of the spatiotemporal parameters by age (1 to 89 years), sex and pace."""
    if age is None or sex is None:
        return NormValues(reason="age_unknown" if age is None else "sex_unknown")
    table = {r["parameter"]: r for r in _people(age, sex) if r["pace"] == pace}
    values = {}
    for name, key in list_norm_keys("walkway").items():
        if key.row not in table:
            continue
        row = table[key.row]
        note = _BAND if row["kind"] != "mean_sd" else _DIFFERS[key.differs]
        first, last = row["age_min"], row["age_max"]
        ages = (
            Message("{first} years", first=first)
            if first == last
            else Message("{first} to {last} years", first=first, last=last)
        )
        values[name] = NormValue(
            name=name,
            mean=float(row["mean"]),
            sd=float(row["sd"]),
            n=None,
            group=Message("{sex}, {ages}, {pace} pace", sex=sex, ages=ages, pace=pace),
            source=row["source"],
            comparable=not note,
            note=note,
        )
    return NormValues(values, None if values else "no_norm_for_age")


def explain_difference(name: str) -> str:
    """Why the walkway reference of a parameter is not comparable with ours; empty if it is."""
    norm = CATALOGUE[name].norm
    return "" if norm is None else _DIFFERS[norm.differs]


def comfortable_speed(age: float | None, sex: Sex | None) -> NormValue | None:
    """Comfortable speed of healthy people of this age: reference for a person's own speed.

    By age and sex if the walkway tables have a mean, else that of the adults of the angle norms; None for
    children with only a range for the pace class.
    """
    if age is not None and sex is not None:
        norm = temporal_values(age, sex).values.get("gait_speed_mps")
        if norm is not None and norm.comparable:
            return norm
    group = wbds_group(age)
    if group is None:
        return None
    mean, sd = WBDS_MPS
    everybody = "adult_21_84"
    return NormValue("gait_speed_mps", mean, sd, WBDS_N[everybody], everybody, WBDS)


def pace_of(age: float | None, sex: Sex | None, speed_mps: float | None) -> Pace | None:
    """Class of the walkway norms for a speed, None if no such people walked at this speed.

    Ages with slow, normal and fast classes have a speed range for each; the others walked only at comfortable
    speed and are "normal". Without a speed, age or sex: "normal".
    """
    if age is None or sex is None or speed_mps is None:
        return "normal"
    bands = [r for r in _people(age, sex) if r["parameter"] == "speed_m_s" and r["kind"] == "speed_band"]
    if not bands:
        return "normal"
    for r in bands:
        if float(r["lo_1sd"]) <= speed_mps < float(r["hi_1sd"]):
            return cast("Pace", r["pace"])
    return None


def predict_at_speed(
    speed_mps: float, age: float | None, leg_m: float | None = None
) -> Mapping[str, NormValue]:
    """Step length and cadence expected at a walking speed, 0.5 to 1.5 m/s on a treadmill; empty outside.

    y = a·v^b with a log-normal residual; `sd` is its width to first order. With the leg length the
    dimensionless fit is used: step length / L and cadence √(L / g) against v / √(g L).
    """
    if not 0.5 <= speed_mps <= 1.5:
        return {}
    # the source's young are 21 to 37, its older 50 to 84 years; between them all are used
    group = "All" if age is None or 40 <= age < 50 else "Young" if age < 40 else "Older"
    if leg_m is None:
        x, scale = speed_mps, {"StepLength": 1.0, "Cadence": 1.0}
    else:
        x, scale = speed_mps / sqrt(GRAVITY * leg_m), {"SLhat": leg_m, "fhat": 60.0 * sqrt(GRAVITY / leg_m)}
    values = {}
    for row in read_rows("spatiotemporal_speed_regression_h2a"):
        if row["y"] not in scale or row["group"] != group:
            continue
        name = _EXPECTED[row["y"]]
        mean = float(row["a"]) * x ** float(row["b"]) * scale[row["y"]]
        values[name] = NormValue(
            name=name,
            mean=mean,
            sd=mean * float(row["resid_sd_ln"]),
            n=int(row["n"]) // _SPEEDS,
            group=Message("{lower} adults at this speed on a treadmill", lower=group.lower()),
            source="BMClab h2a (MIT)",
        )
    return values


_SPEEDS: Final = 6
"""Speeds each person of that source walked at; `n` counts walks."""

_EXPECTED: Final[Mapping[str, str]] = {
    "StepLength": "step_length_m",
    "SLhat": "step_length_m",
    "Cadence": "cadence_spm",
    "fhat": "cadence_spm",
}
"""Fitted quantity → our parameter."""


def _people(age: float, sex: Sex) -> list[Mapping[str, str]]:
    """Rows of one age and sex, all paces."""
    letter = "F" if sex == "female" else "M"
    return [
        r
        for r in read_rows("spatiotemporal_age_sex")
        if r["sex"] == letter and float(r["age_min"]) <= age < float(r["age_max"]) + 1
    ]
