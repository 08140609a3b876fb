"""Result types of parameters: a number with its spread, or no number with its reason."""

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
    side : "left", "right" or None for the whole recording. n : number of strides. mean, sd : None with a
        `reason` if undefined (sd also if n < 2).
    reason : None, or a stable code: "no_strides", "opposite_foot_missing", "no_terminal_contact" …
    cv_pct : coefficient of variation; None below 10 strides, for angles and if any value is not positive.
    ci_low, ci_high : 95 % confidence interval of the mean over the strides, None if n < 2. note : remark on
        the number: "few_strides" below 30; None.
    uncertainty : half width of the 95 % interval from strides and measurement
        (core/parameters/uncertainty.py); None if the measurement uncertainty is unknown, and for a single
        stride.
    u_own, u_common : standard uncertainties of the measurement that do not average out over strides: of this
        side in this recording, and common to both sides and all recordings.
    estimated : based on an angle that is not measured by two sensors but estimated by a leg model.
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
    mean, sd : (101,) rad; None without strides, sd also with fewer than two. NaN where most strides are at
        the bound of a leg model. n : number of strides.
    """

    mean: Floats | None
    sd: Floats | None
    n: int


@dataclass(frozen=True, eq=False)
class CycleCurves:
    """Angles over the gait cycle, for counted and excluded strides alike.

    Parameters
    ----------
    curves : variable without side, e.g. "knee_flexion" → side → (strides, 101) rad, 0 to 100 % of cycle;
        NaN rows for strides with gaps. Row i belongs to `stride_index[side][i]` of the stride list.
    used : side → (strides,) True if the stride is counted.
    foot_off_pct : side → (strides,) terminal contact in % of cycle, NaN if not detected. why : variable →
        side → reason for an angle that was suppressed, or impossible in some stride.
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
        """Cache of `mean_curve`, by variable and side."""
        return {}
