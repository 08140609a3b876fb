"""What a parameter is: a number with its spread, or no number with its reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from sagittal.core.frames import Bools, Floats, Posture, Side


@dataclass(frozen=True)
class Parameter:
    """One row of the parameter table.

    Parameters
    ----------
    name : field term with its unit, e.g. "stride_time_s" (docs/reference/parameters.md).
    side : "left", "right" or None for the whole take.
    n : strides behind the number. mean, sd : None with a `reason` when undefined (sd also when n < 2).
    reason : None, or a stable code: "no_strides", "opposite_foot_missing", "no_terminal_contact" …
    cv_pct : coefficient of variation; None below 10 strides, for angles and where a value is not positive.
    ci_low, ci_high : 95 % confidence interval of the mean over the strides, None when n < 2.
    note : what to know about the number: "few_strides" below 30; None.
    uncertainty : the value ± this holds the truth with 95 %, from its strides and its measurement
        (core/parameters/uncertainty.py); None where the measurement's part is not known, and of one stride.
    u_own, u_common : standard uncertainties of the measurement that strides do not average out: of this side
        in this take, and shared by both sides and every take.
    estimated : of an angle that no two sensors measure: a model of the leg gives it.
    """

    name: str
    side: Side | None
    n: int
    mean: float | None
    sd: float | None
    unit: str
    reason: str | None = None
    cv_pct: float | None = None
    ci_low: float | None = None
    ci_high: float | None = None
    note: str | None = None
    uncertainty: float | None = None
    u_own: float | None = None
    u_common: float | None = None
    estimated: bool = False


@dataclass(frozen=True, eq=False)
class MeanCurve:
    """Mean and standard deviation over the counted strides.

    Parameters
    ----------
    mean, sd : (101,) rad; None without strides, sd also with fewer than two. NaN where most strides rest on
        the bound of a leg model. n : strides behind them.
    """

    mean: Floats | None
    sd: Floats | None
    n: int


@dataclass(frozen=True, eq=False)
class CycleCurves:
    """Angles over the gait cycle, used and unused strides alike.

    Parameters
    ----------
    curves : variable without side, e.g. "knee_flexion" → side → (strides, 101) rad, 0 to 100 % of cycle;
        NaN rows where the stride has gaps. Row i belongs to `stride_index[side][i]` of the stride list.
    used : side → (strides,) True where the stride counts.
    foot_off_pct : side → (strides,) terminal contact in % of cycle, NaN if not found.
    why : variable → side → reason of an angle that was withheld, or impossible in some stride.
    bounds : variable → side → rad, as `JointAngles.bounds`. zero : as `JointAngles.zero`.
    """

    curves: Mapping[str, Mapping[Side, Floats]]
    stride_index: Mapping[Side, tuple[int, ...]]
    used: Mapping[Side, Bools]
    foot_off_pct: Mapping[Side, Floats]
    why: Mapping[str, Mapping[Side, str]] = field(default_factory=dict)
    bounds: Mapping[str, Mapping[Side, float]] = field(default_factory=dict)
    zero: Posture = "standing"

    @cached_property
    def means(self) -> dict[tuple[str, Side], MeanCurve]:
        """Mean curves that somebody has asked `mean_curve` for, by variable and side."""
        return {}
